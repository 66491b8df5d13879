"""The agent's release; `robot.bodies.ev3.archive` writes the real one into the archive."""

RELEASE = "not packed"
