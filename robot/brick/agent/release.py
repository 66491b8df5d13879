"""Which agent this is; `robot.brick.archive` writes the true release into the archive."""

RELEASE = "not packed"
