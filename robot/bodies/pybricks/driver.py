"""A LEGO hub with Pybricks, over Bluetooth LE. The hub runs docs/examples/firmware/hub.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.pybricks.hub_line import HubLine
from robot.bodies.remote.driver import MessageLine, ReportingDriver
from robot.bodies.remote.orders import moves_option, parse_moves
from robot.bodies.remote.same_device import SameDevice
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.errors import need


@dataclass(frozen=True, slots=True, kw_only=True)
class PybricksOptions(Options):
    """The hub to use, and its program's moves."""

    hub: str = option("", "the hub's name or address; needed if several are in range")
    body_moves: str = moves_option("forward,left,right,backward")


class PybricksDriver(ReportingDriver):
    """Sends the names of moves to the program on the hub, whose firmware times each move."""

    name: ClassVar[str] = "pybricks"
    options_type: ClassVar[type[Any]] = PybricksOptions
    no_answer = "is docs/examples/firmware/hub.py running on it?"
    no_obedience = "is it running docs/examples/firmware/hub.py of this version?"

    def __init__(self, options: PybricksOptions, clock: Clock | None = None) -> None:
        super().__init__(options, f"the hub {options.hub!r}" if options.hub else "the hub", clock)
        self.declared_moves = parse_moves(options.body_moves)
        self._same = SameDevice("hub", options.hub)

    @property
    def device(self) -> str:
        return str(self._same.chosen or "")

    def _open_line(self) -> MessageLine:
        bluetooth = need("bleak", "the robot 'pybricks'", "pybricks")
        return HubLine(bluetooth, self.options.hub, self._clock, self._same)
