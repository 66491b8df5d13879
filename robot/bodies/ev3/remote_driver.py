"""A brick elsewhere: its motors and sensors through the agent that runs on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.ev3.chassis import ChassisBody, ChassisDriver, ChassisOptions
from robot.bodies.ev3.link import BrickLink
from robot.bodies.ev3.remote_body import RemoteBody
from robot.devices.options import option


@dataclass(frozen=True, slots=True, kw_only=True)
class Ev3RemoteOptions(ChassisOptions):
    """How the robot is built, and where its brick is."""

    brick: str = option("", "address of the brick, as ev3dev.local or 192.168.1.7:8765")
    brick_secret: str = option(
        "", "secret shared with the agent; else the one that `brick agent` kept", secret=True
    )


class Ev3RemoteDriver(ChassisDriver):
    """A Lego Mindstorms EV3 that lends its body to a server elsewhere."""

    name: ClassVar[str] = "ev3-remote"
    default_camera: ClassVar[str] = "ev3-remote"
    options_type: ClassVar[type[Any]] = Ev3RemoteOptions
    options: Ev3RemoteOptions

    def __init__(self, options: Ev3RemoteOptions, link: BrickLink | None = None) -> None:
        super().__init__(options)
        self.link = link or BrickLink(options.brick, options.brick_secret)

    def _make_body(self) -> ChassisBody:
        return RemoteBody(self.link, self.options.ports())
