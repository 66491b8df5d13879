"""Which agent this is; `robot.bodies.ev3.archive` writes the true release into the archive."""

RELEASE = "not packed"
