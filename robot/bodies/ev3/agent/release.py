"""The agent's release. The agent's archive contains another version of this file, which
`robot.bodies.ev3.archive` writes with the real release."""

RELEASE = "not packed"
