"""Motors on the pins of a Raspberry Pi, by gpiozero, in a separate process."""

from __future__ import annotations

import importlib.util
import json
import sys
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.gpio.keeper_line import KeeperLine
from robot.bodies.remote.driver import MessageLine, ReportingDriver
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.driver import Correction
from robot.errors import ConfigurationError, MissingExtraError
from robot.moves import CLASSIC

MAX_PIN = 27


@dataclass(frozen=True, slots=True, kw_only=True)
class GpioOptions(Options):
    """The wiring of the motors. Pins are gpiozero's GPIO numbers."""

    left_pins: str = option("17,18", "the left motor's two pins: forward,backward")
    right_pins: str = option("22,23", "the right motor's two pins: forward,backward")
    motor_board: str = option(
        "two-pwm",
        "two-pwm: a pin for each direction (L298N, TB6612, DRV8833); phase-enable: the "
        "first pin is the direction, the second the speed; servo-esc: a car with servo and ESC",
        choices=("two-pwm", "phase-enable", "servo-esc"),
    )
    esc_pin: str = option("13", "pin of a car's electronic speed controller (ESC)")
    servo_pin: str = option("12", "pin of a car's steering servo")
    servo_ends: str = option(
        "-1,1",
        "the servo's values at full left and full right; 1,-1 for a servo that turns the other way",
    )
    bumper_pin: str = option("", "pin of a bumper that switches to ground; empty if none")
    straight_speed: float = option(
        0.6, "speed straight ahead, as a share of the motors' full speed", range=(0.01, 1.0)
    )
    turn_speed: float = option(
        0.4, "speed in turns, as a share of the motors' full speed", range=(0.01, 1.0)
    )

    def check(self) -> None:
        self.settings()

    def settings(self) -> dict[str, Any]:
        """Return the settings for the process that owns the pins. Raises ConfigurationError if a
        pin does not exist or is used twice."""
        names = ("esc_pin", "servo_pin") if self.is_car else ("left_pins", "right_pins")
        motors = [self._pins(name, 1 if self.is_car else 2) for name in names]
        bumper = self._pins("bumper_pin", 1) if self.bumper_pin else []
        used = [*motors[0], *motors[1], *bumper]
        if len(set(used)) != len(used):
            named = (f"{_flag(n)} {getattr(self, n) or 'none'}" for n in (*names, "bumper_pin"))
            raise ConfigurationError(f"the same pin is used twice: {', '.join(named)}")
        return {
            "motor_board": self.motor_board,
            "motor_pins": motors,
            "servo_ends": self._servo_ends() if self.is_car else None,
            "bumper_pin": bumper[0] if bumper else None,
            "straight_speed": self.straight_speed,
            "turn_speed": self.turn_speed,
        }

    @property
    def is_car(self) -> bool:
        """True for a car: one motor, and a servo that steers."""
        return self.motor_board == "servo-esc"

    def _pins(self, name: str, count: int) -> list[int]:
        text = getattr(self, name)
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != count or not all(p.isdecimal() and int(p) <= MAX_PIN for p in parts):
            wanted = "one GPIO number" if count == 1 else f"{count} GPIO numbers (such as 17,18)"
            raise ConfigurationError(
                f"{_flag(name)} must be {wanted} from 0 to {MAX_PIN}, not {text!r}"
            )
        return [int(part) for part in parts]

    def _servo_ends(self) -> tuple[float, float]:
        try:
            left, right = map(float, self.servo_ends.split(","))
        except ValueError:
            left = right = 0.0
        if left == right or not (-1.0 <= left <= 1.0 and -1.0 <= right <= 1.0):
            raise ConfigurationError(
                "--servo-ends must be two different numbers from -1 to 1 (such as -0.8,1), not "
                f"{self.servo_ends!r}"
            )
        return left, right


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")


class GpioDriver(ReportingDriver):
    """A Raspberry Pi with a motor driver board; the process that owns the pins times each move."""

    name: ClassVar[str] = "gpio"
    default_camera: ClassVar[str] = "picamera2"
    options_type: ClassVar[type[Any]] = GpioOptions
    declared_moves = tuple(CLASSIC.values())
    takes_points = True
    turns_motors: ClassVar[bool] = True
    no_answer = "is another program using its pins?"
    no_obedience = "restart this program"

    def __init__(self, options: GpioOptions, clock: Clock | None = None) -> None:
        super().__init__(options, "the process that holds the pins", clock)
        if options.is_car:
            self.declared_moves = tuple(move for move in CLASSIC.values() if move.throttle)

    def _open_line(self) -> MessageLine:
        if importlib.util.find_spec("gpiozero") is None:
            raise MissingExtraError("the robot 'gpio'", "gpio")
        settings = json.dumps(self.settings())
        return KeeperLine([sys.executable, "-m", "robot.bodies.gpio.keeper", settings], self._clock)

    def settings(self) -> dict[str, Any]:
        """Return the settings for the process that owns the pins, including corrections."""
        left, right = self.correction.signs
        # A car has only one motor, which is reversed if the left or right side is reversed.
        # `--servo-ends` reverses the steering servo.
        signs = (min(left, right), 1.0) if self.options.is_car else (left, right)
        return {**self.options.settings(), "signs": signs}

    def correct(self, correction: Correction) -> None:
        """See `Driver`. If the correction changes which motors are reversed, a new process takes
        over the pins."""
        is_rewired = self.is_connected and correction.signs != self.correction.signs
        super().correct(correction)
        if is_rewired:
            self.disconnect()
            self.connect()
