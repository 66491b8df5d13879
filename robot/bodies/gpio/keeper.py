"""The process that holds the pins: it stops the motors when the robot's program dies or freezes.

`python -m robot.bodies.gpio.keeper JSON` reads orders from its input and writes reports to its
output. A pin keeps what it was set to when the program that set it is killed or held up, so the
one that holds it does nothing else: no camera, no learner, no network.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
from typing import Any

from robot.bodies.gpio.wheels import TimedMotors, steered, tracked
from robot.bodies.remote.plain import encode_plain_report
from robot.clock import Clock, RealClock

READY = b"ready"
_FAILED = b"failed "
_LONGEST_LINE = 200


def make_motors(settings: dict[str, Any]) -> TimedMotors:
    """Take the pins; raises whatever gpiozero does."""
    import gpiozero

    kind = {"two-pwm": "Motor", "phase-enable": "PhaseEnableMotor", "servo-esc": "Servo"}
    make = getattr(gpiozero, kind[settings["motor_board"]])
    speeds = settings["straight_speed"], settings["turn_speed"]
    ends = settings["servo_ends"]
    bumper = None if settings["bumper_pin"] is None else gpiozero.Button(settings["bumper_pin"])
    return TimedMotors(
        [make(*pins) for pins in settings["motor_pins"]],
        tracked(*speeds) if ends is None else steered(*speeds, ends),
        None if bumper is None else (lambda: bool(bumper.is_pressed)),
    )


def keep(motors: TimedMotors, source: int, sink: int, clock: Clock) -> None:
    """Obey until `source` ends, which it does when the robot's program is gone; then stand."""
    rest = b""
    try:
        while True:
            left_ms = motors.left_ms(_ms(clock))
            ready, _, _ = select.select(
                [source], [], [], None if left_ms is None else left_ms / 1000
            )
            motors.tick(_ms(clock))
            if not ready:
                continue
            data = os.read(source, 65_536)
            if not data:
                return
            *lines, rest = (rest + data).split(b"\n")
            rest = rest[-_LONGEST_LINE:]
            for line in lines:
                report = motors.obey(line, _ms(clock))
                os.write(sink, encode_plain_report(report) + b"\n")
    except (BrokenPipeError, BlockingIOError):  # nobody reads: as good as gone
        return
    finally:
        motors.stand()


def _ms(clock: Clock) -> int:
    return int(1000 * clock.now_s())


def main() -> None:
    for quiet in (signal.SIGINT, signal.SIGHUP):  # they are meant for the robot's program
        signal.signal(quiet, signal.SIG_IGN)
    try:
        motors = make_motors(json.loads(sys.argv[1]))
    except Exception as error:  # a sentence for whoever started this, whatever the library says
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        os.write(1, _FAILED + reason.encode() + b"\n")
        return
    os.write(1, READY + b"\n")
    keep(motors, 0, 1, RealClock())


if __name__ == "__main__":
    main()
