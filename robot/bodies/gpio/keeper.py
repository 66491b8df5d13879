"""The process that holds the pins: it stops the motors when the robot's program dies or freezes.

`python -m robot.bodies.gpio.keeper JSON` takes orders from the pipe that is its standard input, and
answers each with a report there. A pin keeps what it was set to when the program that set it is
killed or held up, so the one that holds it does nothing else: no camera, no learner, no network.
It is a child of one that does still less, and waits to put another in its place.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

from robot.bodies.gpio.wheels import TimedMotors, steered, tracked
from robot.bodies.remote.plain import encode_plain_report
from robot.clock import Clock, RealClock

READY = b"ready"
FAILED = b"failed "
NO_PINS = "this computer has no GPIO pins that gpiozero can use; run it on the Raspberry Pi"
_LONGEST_ORDER = 200


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
        settings["signs"],
    )


def keep(motors: TimedMotors, line: Connection, clock: Clock) -> None:
    """Obey until the line ends, which it does when the robot's program is gone; then stand."""
    try:
        while True:
            left_ms = motors.left_ms(_ms(clock))
            is_asked = line.poll(None if left_ms is None else left_ms / 1000)
            motors.tick(_ms(clock))
            if is_asked:
                report = motors.obey(line.recv_bytes(_LONGEST_ORDER), _ms(clock))
                line.send_bytes(encode_plain_report(report))
    except (EOFError, ConnectionError):  # a fault of the pins is none of these: it is shown
        return
    finally:
        motors.stand()


def _ms(clock: Clock) -> int:
    return int(1000 * clock.now_s())


def hold(settings: dict[str, Any]) -> None:
    """Take the pins, and keep them; tell the caller that it can, or why it cannot."""
    line = Connection(0)
    try:
        motors = make_motors(settings)
    except Exception as error:  # a sentence, whatever the library says
        reason = NO_PINS if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        line.send_bytes(FAILED + " ".join(reason.split()).encode())
        return
    line.send_bytes(READY)
    keep(motors, line, RealClock())


def _kill(pid: int, *_: object) -> None:
    with contextlib.suppress(ProcessLookupError):  # it ended in the very moment it was given up
        os.kill(pid, signal.SIGKILL)


def outlive(work: Callable[[], None]) -> None:
    """Have a child do it, and another one if that is killed, until one has ended by itself.

    SIGUSR1 kills one that hangs. The next has the pins within milliseconds, and stops the motors:
    a program that has to be started first needs seconds, in which they go on.
    """
    while child := os.fork():
        signal.signal(signal.SIGUSR1, partial(_kill, child))
        _, status = os.waitpid(child, 0)
        if os.WIFEXITED(status):
            return
    work()


def main() -> None:
    # They are meant for the robot's program, after which this one ends with its motors at rest.
    for quiet in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(quiet, signal.SIG_IGN)
    with contextlib.suppress(ImportError):  # before there are children: each says what is missing
        import gpiozero  # noqa: F401
    outlive(lambda: hold(json.loads(sys.argv[1])))


if __name__ == "__main__":
    main()
