"""The body of a robot at the other end of a link."""

from __future__ import annotations

import contextlib
import time
from typing import Any

from robot.brick.agent.ports import HardwareError
from robot.brick.link import BrickLink


class RemoteBody:
    """A body at the other end of a link, with the same methods as the brick's own."""

    def __init__(self, link: BrickLink, **ports: str) -> None:
        self._link = link
        self._ports = ports

    def open(self) -> None:
        """Join the brick and have it find its motors and sensors."""
        self._link.open("body")
        self._link.wish("body", "open", **self._ports)
        self._link.answer("opened")

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels for at most `time_ms`."""
        self._link.say("run", left=left_dps, right=right_dps, ms=time_ms, t=time.monotonic())

    def stop(self) -> None:
        """Stop the motors; if the line is lost the brick does so by itself."""
        with contextlib.suppress(HardwareError):
            self._link.say("stop", t=time.monotonic())

    def positions(self) -> list[float]:
        """How far each wheel has turned, in degrees; asks the brick and waits."""
        self._link.say("positions")
        return [float(degrees) for degrees in self._link.answer("positions")]

    def sense(self) -> dict[str, Any]:
        """Return what the brick last told."""
        return self._link.sensors()

    def take_button(self) -> str | None:
        """Return the brick's button that was pressed."""
        return self._link.take_button()

    def show(self, mode: str, address: str) -> None:
        """Show mode and address on the brick."""
        with contextlib.suppress(HardwareError):
            self._link.wish("show", "show", mode=mode, address=address)

    def close(self) -> None:
        """Stop the motors and hang up, unless the camera still uses the line."""
        self.stop()
        self._link.forget("body")
        self._link.forget("show")
        with contextlib.suppress(HardwareError):
            self._link.say("close")
        self._link.close("body")
