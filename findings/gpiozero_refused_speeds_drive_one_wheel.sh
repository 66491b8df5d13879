#!/bin/sh
# gpiozero 2.0.1.post3: when Robot refuses a pair of speeds, it has already changed the left wheel.
#
# Guess before running: `robot.value = (0.2, -2)` raises an error, and the robot keeps its previous speeds.
# Outcome: half wrong. It raises OutputDeviceBadValue, but the two motors are set one after the other. Afterwards the
# left motor runs at 0.2, and the right motor as before. If a program catches the error, its robot turns. The order
# matters: (-2, 0.2) changes nothing.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet gpiozero==2.0.1.post3
"$folder/env/bin/python" - <<'EOF'
from gpiozero import Device, OutputDeviceBadValue, Robot
from gpiozero.pins.mock import MockFactory, MockPWMPin

Device.pin_factory = MockFactory(pin_class=MockPWMPin)
robot = Robot(left=(2, 3), right=(4, 5))


def after(speeds: tuple[float, float]) -> tuple[float, float]:
    robot.stop()
    try:
        robot.value = speeds
    except OutputDeviceBadValue:
        return tuple(robot.value)
    raise AssertionError("it was not refused")


found = {speeds: after(speeds) for speeds in ((0.2, -2), (-2, 0.2))}
print(found)
assert found == {(0.2, -2): (0.2, 0.0), (-2, 0.2): (0.0, 0.0)}
EOF
