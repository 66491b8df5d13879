#!/bin/sh
# gpiozero 2.0.1.post3: PhaseEnableRobot, the class for boards with phase and enable pins, cannot be constructed.
#
# Guess before running: it is an older name for Robot with PhaseEnableMotor inside; it warns, and works.
# Outcome: wrong. It passes `pwm` on to Robot, which has no such argument. Each call therefore raises a TypeError
# about `pwm`, although the caller did not give it. Robot with two PhaseEnableMotor objects works.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet gpiozero==2.0.1.post3
"$folder/env/bin/python" - <<'EOF'
import warnings

from gpiozero import Device, PhaseEnableMotor, PhaseEnableRobot, Robot
from gpiozero.pins.mock import MockFactory, MockPWMPin

warnings.simplefilter("ignore")
Device.pin_factory = MockFactory(pin_class=MockPWMPin)
try:
    PhaseEnableRobot(left=(2, 3), right=(4, 5))
    told = "made"
except TypeError as error:
    told = str(error)
robot = Robot(left=PhaseEnableMotor(6, 7), right=PhaseEnableMotor(8, 9))
robot.left(0.5)
print(told, tuple(robot.value))
assert "'pwm'" in told
assert tuple(robot.value) == (-0.5, 0.5)
EOF
