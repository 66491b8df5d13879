"""An EV3 as it came out of the box: LEGO's own firmware, no card, over Wi-Fi, Bluetooth or USB."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.ev3.chassis import ChassisBody, ChassisDriver, ChassisOptions
from robot.bodies.ev3.stock.body import StockBody
from robot.bodies.ev3.stock.lines import BEACON_PORT, open_line
from robot.devices.options import option


@dataclass(frozen=True, slots=True, kw_only=True)
class Ev3StockOptions(ChassisOptions):
    """How the robot is built, and how to reach its brick."""

    line: str = option("usb", "way to the brick", choices=("usb", "bluetooth", "wifi"))
    brick: str = option("", "the brick's ID, as 00:16:53:3f:0c:1e; needed for Bluetooth only")
    beacon_port: int = option(BEACON_PORT, "UDP port of bricks on Wi-Fi", range=(1, 65535))


class Ev3StockDriver(ChassisDriver):
    """A Lego Mindstorms EV3 with LEGO's own firmware; each move is timed by the brick."""

    name: ClassVar[str] = "ev3-stock"
    default_camera: ClassVar[str] = "phone"
    options_type: ClassVar[type[Any]] = Ev3StockOptions
    is_remote: ClassVar[bool] = True
    options: Ev3StockOptions

    def _make_body(self) -> ChassisBody:
        options = self.options
        return StockBody(
            lambda: open_line(options.line, options.brick, options.beacon_port), options.ports()
        )
