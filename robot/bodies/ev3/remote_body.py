"""The body of a robot at the other end of a link."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import Any

from robot.bodies.ev3.agent.ports import HardwareError
from robot.bodies.ev3.link import BrickLink


class RemoteBody:
    """A body at the other end of a link, with the same methods as the brick's own."""

    def __init__(self, link: BrickLink, ports: Mapping[str, str]) -> None:
        self._link = link
        self._ports = ports

    def open(self) -> Sequence[float]:
        self._link.open("body")
        self._link.keep_sent("body", "open", **self._ports)
        return [float(dps) for dps in self._link.answer("opened")["top_speeds_dps"]]

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels for at most `time_ms`. The brick refuses an order that comes late.

        Raises:
            HardwareError: If the line is lost or the brick silent; it stops by itself then.
        """
        after_s, fault = self._link.report_time_s, self._link.fault
        if after_s is None or fault is not None:
            raise HardwareError(fault or "the brick has not reported yet")
        self._link.send("run", left=left_dps, right=right_dps, ms=time_ms, after=after_s)

    def stop(self) -> None:
        """Stop the motors; if the line is lost the brick does so by itself."""
        with contextlib.suppress(HardwareError):
            self._link.send("stop")

    def positions(self) -> list[float]:
        self._link.send("positions")
        return [float(degrees) for degrees in self._link.answer("positions")]

    def sense(self) -> dict[str, Any]:
        return self._link.sensors()

    def take_button(self) -> str | None:
        return self._link.take_button()

    def show(self, mode: str, address: str) -> None:
        with contextlib.suppress(HardwareError):
            self._link.keep_sent("show", "show", mode=mode, address=address)

    def close(self) -> None:
        self.stop()
        self._link.forget("body")
        self._link.forget("show")
        with contextlib.suppress(HardwareError):
            self._link.send("close")
        self._link.close("body")
