"""A LEGO hub with Pybricks, over Bluetooth LE: docs/examples/firmware/hub.py runs on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

from robot.clock import Clock
from robot.drivers.pybricks.hub_line import HubLine
from robot.drivers.remote.driver import ReportingDriver
from robot.drivers.remote.line import MessageLine
from robot.drivers.remote.orders import BodyReport, parse_moves
from robot.errors import MissingExtraError
from robot.types import Action, Sensors


@dataclass(frozen=True, slots=True, kw_only=True)
class PybricksOptions:
    """Which hub, and what its program can do."""

    hub: str = field(
        default="", metadata={"help": "the hub's name; needed if several are in reach"}
    )
    body_moves: str = field(
        default="forward,left,right,backward",
        metadata={"help": "what the body can do, as forward,left or fast:0:1 (steering:throttle)"},
    )


def parse_hub_report(data: bytes) -> BodyReport | None:
    """Read one line of the hub's program: number, its clock, distance, bumper, battery; or None.

    As `7 81240 420 0 80`: milliseconds, millimetres, 0 or 1, percent; `-` where there is no sensor.
    """
    words = data.split()
    if len(words) != 5 or not (words[0].isdigit() and words[1].isdigit()):
        return None
    distance_mm, bumped, battery = (_number(word) for word in words[2:])
    return BodyReport(
        nonce="",
        seq=int(words[0]),
        ms=int(words[1]),
        sensors=Sensors(
            # 2000 mm is what the sensor says when it sees nothing.
            distance_m=None if distance_mm is None else min(distance_mm / 1000, 10.0),
            bumped=None if bumped is None else bumped > 0,
            battery_share=None if battery is None else min(battery / 100, 1.0),
        ),
    )


def _number(word: bytes) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0 else None


class PybricksDriver(ReportingDriver):
    """Sends the names of moves to the program on the hub, whose firmware times each of them."""

    name: ClassVar[str] = "pybricks"
    options_type: ClassVar[type[Any]] = PybricksOptions
    hello = b"?"
    no_answer = "does docs/examples/firmware/hub.py run on it?"
    no_obedience = "does it run docs/examples/firmware/hub.py of this version?"

    def __init__(
        self, options: PybricksOptions, clock: Clock | None = None, bluetooth: Any = None
    ) -> None:
        super().__init__(clock)
        self.options = options
        self.declared_moves = parse_moves(options.body_moves)
        self._bluetooth = bluetooth

    @property
    def _where(self) -> str:
        return f"the hub {self.options.hub!r}" if self.options.hub else "the hub"

    def _open(self) -> MessageLine:
        bluetooth = self._bluetooth
        if bluetooth is None:
            try:
                import bleak as bluetooth
            except ImportError as error:
                raise MissingExtraError("the robot 'pybricks'", "pybricks") from error
        return HubLine(bluetooth, self.options.hub)

    def _parse(self, data: bytes) -> BodyReport | None:
        return parse_hub_report(data)

    def _encode(
        self, action: Action, *, for_ms: int, speed: float, seq: int, report: BodyReport
    ) -> bytes:
        return f"{action} {for_ms} {round(speed, 3)} {seq} {report.ms}".encode()
