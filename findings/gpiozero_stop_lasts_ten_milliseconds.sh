#!/bin/sh
# gpiozero 2.0.1.post3: stop() does not stop a robot that has a source.
#
# Guess before running: after robot.stop() the robot stands still, because stop() ends the source. If the source gives
# a speed of 1.01, the motors stop.
# Outcome: wrong. stop() sets the speeds to 0 once. The source's thread sets them again after 0.01 s (source_delay),
# and the robot drives on. A speed beyond 1 ends that thread with an exception that no caller sees, and the motors
# keep their previous speed. When the source is exhausted, they keep its last speed. Only `source = None` followed by
# stop() stops the robot.
#
# Our driver for this library sets each speed itself.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check gpiozero==2.0.1.post3
"$folder/env/bin/python" - <<'PY'
import itertools
import threading
import time

from gpiozero import Device, Robot
from gpiozero.pins.mock import MockFactory, MockPWMPin

Device.pin_factory = MockFactory(pin_class=MockPWMPin)
robot = Robot(left=(2, 3), right=(4, 5))
raised = []
threading.excepthook = lambda args: raised.append(args.exc_type.__name__)


def speeds_after(source, is_stopped: bool) -> tuple[float, float]:
    robot.source = source
    time.sleep(0.3)
    if is_stopped:
        robot.stop()
        time.sleep(0.3)
    now = tuple(robot.value)
    robot.source = None
    robot.stop()
    assert tuple(robot.value) == (0.0, 0.0)
    return now


half, beyond = (0.5, 0.5), (1.01, 0.5)
found = {
    "stop": speeds_after(itertools.repeat(half), True),
    "beyond": speeds_after(itertools.chain([half], itertools.repeat(beyond)), False),
    "exhausted": speeds_after([half], False),
}
print(found, raised)
assert set(found.values()) == {half} and raised == ["OutputDeviceBadValue"]
PY
