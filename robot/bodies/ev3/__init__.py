"""The EV3 brick: its devices, and the line to a brick that stands elsewhere."""
