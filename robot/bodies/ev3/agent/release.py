"""The agent's release; in the archive `robot.bodies.ev3.archive` replaces it by the real one."""

RELEASE = "not packed"
