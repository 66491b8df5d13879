"""Pictures from a USB camera, for the camera plugin and for the agent on a brick."""
