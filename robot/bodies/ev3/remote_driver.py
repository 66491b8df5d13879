"""A remote brick: its motors and sensors through the agent that runs on it."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.ev3.driver import ChassisBody, ChassisDriver, ChassisOptions
from robot.bodies.ev3.link import BrickLink
from robot.devices.options import option
from robot.errors import DriveError


class RemoteBody:
    """A remote brick's body, with the same methods as `BrickBody`."""

    def __init__(self, link: BrickLink, ports: Mapping[str, str]) -> None:
        self._link = link
        self._ports = ports

    def open(self) -> Sequence[float]:
        self._link.hold("body", "open", **self._ports)
        return [float(dps) for dps in self._link.answer("opened")["top_speeds_dps"]]

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels for at most `time_ms`. The brick drops an order that arrives late.
        Raises DriveError if the connection is lost or the brick is silent; then the brick stops by
        itself."""
        after_s, fault = self._link.report.get("t"), self._link.fault
        if after_s is None or fault is not None:
            raise DriveError(fault or "the brick has not reported yet")
        self._link.send("run", left=left_dps, right=right_dps, ms=time_ms, after=after_s)

    def stop(self) -> None:
        """Stop the motors; if the connection is lost, the brick stops the motors itself."""
        with contextlib.suppress(DriveError):
            self._link.send("stop")

    def positions(self) -> list[float]:
        self._link.send("positions")
        return [float(degrees) for degrees in self._link.answer("positions")]

    def sense(self) -> dict[str, Any]:
        fault = self._link.fault or self._link.report.get("fault")
        if fault is not None:
            raise DriveError(fault)
        return dict(self._link.report.get("sensors") or {})

    def take_button(self) -> str | None:
        buttons, self._link.buttons = self._link.buttons, []
        return "stop" if "stop" in buttons else buttons[-1] if buttons else None

    def show(self, mode: str, address: str) -> None:
        with contextlib.suppress(DriveError):
            self._link.hold("show", "show", mode=mode, address=address)

    def close(self) -> None:
        self.stop()
        with contextlib.suppress(DriveError):
            self._link.send("close")
        self._link.release("body", "show")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ev3RemoteOptions(ChassisOptions):
    """The robot's dimensions, and its brick's address."""

    brick: str = option("", "address of the brick, such as ev3dev.local or 192.168.1.7:8765")
    brick_secret: str = option(
        "", "secret shared with the agent (default: the one that `brick agent` stored)", secret=True
    )


class Ev3RemoteDriver(ChassisDriver):
    """A Lego Mindstorms EV3 that runs the agent, and is driven by a server on another computer."""

    name: ClassVar[str] = "ev3-remote"
    default_camera: ClassVar[str] = "ev3-remote"
    options_type: ClassVar[type[Any]] = Ev3RemoteOptions
    options: Ev3RemoteOptions

    def __init__(self, options: Ev3RemoteOptions, link: BrickLink | None = None) -> None:
        super().__init__(options)
        self.link = link or BrickLink(options.brick, options.brick_secret)

    def _open(self) -> ChassisBody:
        return RemoteBody(self.link, self.options.ports())
