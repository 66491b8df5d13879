#!/bin/sh
# gpiozero 2.0.1.post3: a wheel's encoder counts only to 16, and its count is wrong afterwards.
#
# Guess before running: RotaryEncoder.steps counts every step, and only `value`, which ranges from -1 to 1, is limited
# by max_steps. A wheel that turns 20 steps forward and 20 back is at 0 again.
# Outcome: wrong. Without max_steps=0 the steps are limited as well, to 16 in each direction. 20 steps forward count
# as 16, and the first step back counts from there, so the wheel ends at -4. when_rotated_clockwise is called for all
# 20 steps. A robot that measures its distance with `steps` seems to stop after less than a turn of its wheel, and no
# error is raised. With wrap=True the step after 16 is -16. With max_steps=0 all steps are counted.
#
# The pins are gpiozero's own mock pins.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --no-compile --disable-pip-version-check gpiozero==2.0.1.post3
"$folder/env/bin/python" - <<'PY'
from gpiozero import Device, RotaryEncoder
from gpiozero.pins.mock import MockFactory

FORWARD = [(False, True), (False, False), (True, False), (True, True)]
BACK = [(True, False), (False, False), (False, True), (True, True)]


def turned(**settings: object) -> tuple[int, int, int]:
    """Return the steps after 20 forward, after 20 back, and the number of calls that report a step forward."""
    Device.pin_factory = MockFactory()
    pins = [Device.pin_factory.pin(number) for number in (17, 18)]
    calls = []
    with RotaryEncoder(17, 18, **settings) as encoder:
        encoder.when_rotated_clockwise = lambda: calls.append(1)
        steps = []
        for states in (FORWARD, BACK):
            for _ in range(20):
                for state in states:
                    for pin, is_high in zip(pins, state, strict=True):
                        (pin.drive_high if is_high else pin.drive_low)()
            steps.append(encoder.steps)
        return steps[0], steps[1], len(calls)


found = {"default": turned(), "wrap": turned(wrap=True), "0": turned(max_steps=0)}
print("steps after 20 forward, after 20 back, calls:", found)
assert found["default"] == (16, -4, 20)
assert found["wrap"] == (-13, 0, 20)
assert found["0"] == (20, 0, 20)
PY
