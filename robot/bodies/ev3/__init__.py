"""What touches the brick, and the line to a brick that stands elsewhere."""
