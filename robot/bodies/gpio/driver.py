"""Motors on the pins of a Raspberry Pi, by gpiozero, in a process of their own."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.gpio.keeper_line import KeeperLine
from robot.bodies.gpio.wheels import SHARES
from robot.bodies.remote.driver import ReportingDriver
from robot.bodies.remote.line import MessageLine
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.driver import describe
from robot.errors import ConfigurationError, MissingExtraError

MAX_PIN = 27


@dataclass(frozen=True, slots=True, kw_only=True)
class GpioOptions(Options):
    """How the motors are wired. Pins are GPIO numbers, as gpiozero has them."""

    left_pins: str = option("17,18", "the left motor's two pins: forward,backward")
    right_pins: str = option("22,23", "the right motor's two pins: forward,backward")
    motor_board: str = option(
        "two-pwm",
        "two-pwm: a pin for each direction (L298N, TB6612, DRV8833); phase-enable: the "
        "first pin is the direction, the second the speed",
        choices=("two-pwm", "phase-enable"),
    )
    bumper_pin: str = option("", "pin of a bumper's switch to ground; empty: none")
    straight_speed: float = option(
        0.6, "share of the motors' full speed, straight on", range=(0.01, 1.0)
    )
    turn_speed: float = option(0.4, "share of it in turns", range=(0.01, 1.0))

    def check(self) -> None:
        self.settings()

    def settings(self) -> dict[str, Any]:
        """Return what the process that holds the pins needs.

        Raises:
            ConfigurationError: If a pin is none, or named twice.
        """
        left, right = (_pins(name, getattr(self, name), 2) for name in ("left_pins", "right_pins"))
        bumper = _pins("bumper_pin", self.bumper_pin, 1) if self.bumper_pin else []
        if len({*left, *right, *bumper}) != len(left) + len(right) + len(bumper):
            raise ConfigurationError(
                f"a pin is named twice in --left-pins {self.left_pins}, --right-pins "
                f"{self.right_pins} and --bumper-pin {self.bumper_pin or 'none'}"
            )
        return {
            "left_pins": left,
            "right_pins": right,
            "bumper_pin": bumper[0] if bumper else None,
            "phase_enable": self.motor_board == "phase-enable",
            "straight_speed": self.straight_speed,
            "turn_speed": self.turn_speed,
        }


def _pins(name: str, text: str, count: int) -> list[int]:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != count or not all(p.isdecimal() and int(p) <= MAX_PIN for p in parts):
        wanted = "one GPIO number" if count == 1 else f"{count} GPIO numbers, as 17,18,"
        raise ConfigurationError(
            f"--{name.replace('_', '-')} must be {wanted} from 0 to {MAX_PIN}, not {text!r}"
        )
    return [int(part) for part in parts]


class GpioDriver(ReportingDriver):
    """A Raspberry Pi with a motor driver board; the process that holds the pins times each move."""

    name: ClassVar[str] = "gpio"
    default_camera: ClassVar[str] = "picamera2"
    options_type: ClassVar[type[Any]] = GpioOptions
    declared_moves = describe(SHARES)
    no_answer = "is another program using its pins?"
    no_obedience = "restart this program"

    def __init__(
        self,
        options: GpioOptions,
        clock: Clock | None = None,
        open_line: Callable[[dict[str, Any]], MessageLine] | None = None,
    ) -> None:
        super().__init__(clock)
        self.options = options
        self._start = open_line or self._start_keeper

    @property
    def _where(self) -> str:
        return "the process that holds the pins"

    def _open_line(self) -> MessageLine:
        return self._start(self.options.settings())

    def _start_keeper(self, settings: dict[str, Any]) -> MessageLine:
        if importlib.util.find_spec("gpiozero") is None:
            raise MissingExtraError("the robot 'gpio'", "gpio")
        command = [sys.executable, "-m", "robot.bodies.gpio.keeper", json.dumps(settings)]
        return KeeperLine(command, self._clock)
