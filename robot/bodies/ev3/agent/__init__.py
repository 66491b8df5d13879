"""Motors and sensors of an EV3, and the agent through which another computer's server uses them.

This package is written for the Python 3.5 of ev3dev's stock image, and uses only the standard
library and python-ev3dev2. `robot.bodies.ev3.archive` packs this package, with `robot.bodies.v4l2`,
into one file for the brick. On a brick that runs the server itself, the driver uses `BrickBody`
without the network.

Safety is implemented in this package, next to the motors. Every move is the kernel's command
`run-timed`, which the kernel ends by itself. The agent stops the motors when its controller falls
silent or leaves, and drops old commands.
"""
