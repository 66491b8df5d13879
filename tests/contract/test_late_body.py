"""The contract for a body that acknowledges nothing, written as a third-party author would."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.moves import point_of
from robot.testing import VirtualClock
from robot.testing.cases import DriverCase
from robot.testing.driver_contract import DriverContract
from robot.types import Action, Point

LATE_S = 0.06
STANDS = Point(0.0, 0.0)


class LateDriver(ConnectedDriver[VirtualClock]):
    """A driver whose orders arrive late, with a method name that many authors would use. Its body
    accelerates for longer than one order lasts, and brakes at once."""

    name, default_camera, is_remote, takes_points = "late", "phone", True, True
    is_cut, ramp_s = False, 1.5 * ACTION_TIMEOUT_S

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__(clock=clock)
        self.orders: list[tuple[float, Point]] = []

    def _open(self) -> VirtualClock:
        return VirtualClock()

    def _send(self, point: Point) -> None:
        if self.is_cut:
            raise OSError("cut off")
        self.orders.append((self._clock.now_s() + LATE_S, point))

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        self._send(point or point_of(action, self.declared_moves) or STANDS)

    def sense(self) -> Sensors:
        return Sensors()

    def cut(self) -> None:
        self.orders, self.is_cut = [each for each in self.orders if self._has_come(each)], True

    def drives(self) -> Point:
        came = [(0.0, STANDS), *filter(self._has_come, self.orders)]
        came_s, wanted = came[-1]
        now_s = self._clock.now_s()
        if now_s >= came_s + ACTION_TIMEOUT_S:
            return STANDS
        since_s = next((at_s for (at_s, _), (_, one) in pairwise(came[::-1]) if one != wanted), 0.0)
        share = min(1.0, (now_s - since_s) / self.ramp_s)
        return Point(wanted.steering * share, wanted.throttle * share)

    def _has_come(self, order: tuple[float, Point]) -> bool:
        return order[0] <= self._clock.now_s()


@pytest.mark.parametrize(
    "check",
    [
        check
        for name, check in vars(DriverContract).items()
        if name.startswith("test_") and "declares" not in name and "leaves_nothing" not in name
    ],
)
def test_a_body_that_is_late_keeps_the_contract(check: Any) -> None:
    clock = VirtualClock()
    driver = LateDriver(clock)
    case = DriverCase(
        driver,
        clock.advance,
        lambda: driver.drives() != STANDS,
        driver.cut,
        now_s=clock.now_s,
        restore_link=lambda: setattr(driver, "is_cut", False),
        drives=driver.drives,
        ramp_s=driver.ramp_s,
    )
    check(DriverContract(), case)
