"""The process that owns the pins: it stops the motors when the robot's program dies or freezes.

`python -m robot.bodies.gpio.keeper JSON` reads orders from the socket that is its standard input,
and answers each order with a report on this socket. If the program that set a pin is killed or
hangs, the pin keeps its level. The process that owns the pins therefore does nothing else: no
camera, no learner, no network. Its parent process only waits, and replaces it if it is killed.
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
    """Claim the pins; raises gpiozero's errors."""
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
    """Obey orders until the connection ends, usually because the robot's program ended; then
    stop."""
    try:
        while True:
            left_ms = motors.left_ms(_ms(clock))
            is_asked = line.poll(None if left_ms is None else left_ms / 1000)
            motors.tick(_ms(clock))
            if is_asked:
                report = motors.obey(line.recv_bytes(_LONGEST_ORDER), _ms(clock))
                line.send_bytes(encode_plain_report(report))
    except (EOFError, ConnectionError):  # the caller reports an error from opening the pins
        return
    finally:
        motors.stand()


def _ms(clock: Clock) -> int:
    return int(1000 * clock.now_s())


def hold(settings: dict[str, Any]) -> None:
    """Claim the pins, and report the result to the robot's program. If the pins were claimed, obey
    the program's orders."""
    line = Connection(0)
    try:
        motors = make_motors(settings)
    except Exception as error:  # report any error of the library as a sentence
        reason = NO_PINS if isinstance(error, ImportError) else f"{type(error).__name__}: {error}"
        line.send_bytes(FAILED + " ".join(reason.split()).encode())
        return
    line.send_bytes(READY)
    keep(motors, line, RealClock())


def _kill(pid: int, *_: object) -> None:
    with contextlib.suppress(ProcessLookupError):  # the child process has just ended
        os.kill(pid, signal.SIGKILL)


def outlive(work: Callable[[], None]) -> None:
    """Run the work in a child process. Replace each child that is killed, until a child ends by
    itself.

    SIGUSR1 kills a child that hangs. The next child claims the pins within milliseconds, and stops
    the motors. If the whole program had to be restarted, the motors would run for seconds more.
    """
    while child := os.fork():
        signal.signal(signal.SIGUSR1, partial(_kill, child))
        _, status = os.waitpid(child, 0)
        if os.WIFEXITED(status):
            return
    work()


def main() -> None:
    # Ignore these signals, because they are meant for the robot's program.
    # When the robot's program has ended, this process stops the motors and then ends itself.
    for quiet in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(quiet, signal.SIG_IGN)
    # Import the module before forking, so that each child starts immediately.
    # If gpiozero is missing, the child reports that.
    with contextlib.suppress(ImportError):
        import gpiozero  # noqa: F401
    outlive(lambda: hold(json.loads(sys.argv[1])))


if __name__ == "__main__":
    main()
