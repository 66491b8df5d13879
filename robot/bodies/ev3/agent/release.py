"""The agent's release. In the agent's archive, `robot.bodies.ev3.archive` replaces this value by
the real release."""

RELEASE = "not packed"
