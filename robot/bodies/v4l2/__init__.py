"""Pictures from a USB camera, for the camera plug-in and for the agent on a brick."""
