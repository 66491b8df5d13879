"""Pictures from a USB camera: what both a camera plugin here and the agent on a brick need."""
