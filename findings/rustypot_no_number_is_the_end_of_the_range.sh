#!/bin/sh
# rustypot 1.13.1 (PyPI): a goal that is not a number sends an STS3215 servo to the end of its range.
#
# Guess before running: write_goal_position() raises an error for NaN and for infinity, and raises an error for or
# limits a goal beyond a servo's range, -pi to pi.
# Outcome: wrong for each. NaN is sent as position 0 of 0 to 4095, which is -180 degrees, and infinity as 32767. A
# goal of 4 rad is sent as 4655, and one of 100 rad as 32767. sync_write_goal_position() does the same, and no error
# is raised. An inverse kinematics without a solution, or a policy that diverged, therefore turns the joint as far as
# it goes, unless the servo's own limits are set.
#
# The servo is simulated by a process of this script at the other end of a pseudo-terminal.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check rustypot==1.13.1
"$folder/env/bin/python" - <<'PY'
import math
import os
import pty
import threading
import tty

from rustypot import Sts3215PyController

WRITE, SYNC_WRITE, GOAL_POSITION, SERVO = 3, 0x83, 42, 1
received: list[int] = []


def serve(line: int) -> None:
    """Acknowledge what is written to servo 1, and note the goal positions."""
    data = b""
    while True:
        data += os.read(line, 256)
        while len(data) >= 4 and len(data) >= 4 + data[3]:
            packet, data = data[: 4 + data[3]], data[4 + data[3] :]
            instruction, parameters = packet[4], packet[5:-1]
            assert packet[:2] == b"\xff\xff" and parameters[0] == GOAL_POSITION
            if instruction == WRITE:
                received.append(int.from_bytes(parameters[1:3], "little"))
                os.write(line, b"\xff\xff" + bytes([SERVO, 2, 0, ~(SERVO + 2) & 255]))
            elif instruction == SYNC_WRITE:
                received.append(int.from_bytes(parameters[3:5], "little"))
            done.set()


done = threading.Event()
robot_end, program_end = pty.openpty()
tty.setraw(robot_end)
tty.setraw(program_end)
threading.Thread(target=serve, args=(robot_end,), daemon=True).start()
servos = Sts3215PyController(serial_port=os.ttyname(program_end), baudrate=1_000_000, timeout=5.0)
goals = (0.0, 0.5, math.nan, math.inf, 4.0, 100.0)
sent = {}
for goal in goals:
    for write in (
        lambda goal: servos.write_goal_position(SERVO, goal),
        lambda goal: servos.sync_write_goal_position([SERVO], [goal]),
    ):
        done.clear()
        write(goal)
        assert done.wait(10.0)
    sent[goal] = received[-2:]
    print(f"goal {goal} rad: positions sent, for one servo and for several: {sent[goal]}")
assert list(sent.values()) == [[2048] * 2, [2373] * 2, [0] * 2, [32767] * 2, [4655] * 2, [32767] * 2]
PY
