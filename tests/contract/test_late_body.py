"""The contract on a body that acknowledges nothing, written as a stranger would."""

from __future__ import annotations

from typing import Any

import pytest

from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S
from robot.testing import VirtualClock
from robot.testing.cases import DriverCase
from robot.testing.driver_contract import DriverContract, _check_same, _check_stands
from robot.types import Action, Point, Sensors

LATE_S = 0.06


class LateDriver(ConnectedDriver[VirtualClock]):
    """Its orders arrive later; a method of its own has a name that anybody would take."""

    name, default_camera, is_remote = "late", "phone", True

    def __init__(self, clock: VirtualClock) -> None:
        super().__init__(clock=clock)
        self.orders: list[tuple[float, Action]] = []

    def _open(self) -> VirtualClock:
        return VirtualClock()

    def _send(self, action: Action) -> None:  # type: ignore[override,unused-ignore]
        self.orders.append((self._clock.now_s() + LATE_S, action))

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        self._send(action)

    def sense(self) -> Sensors:
        return Sensors()

    def stop(self) -> None:
        if self.is_connected:
            self._send(Action.STOP)


@pytest.mark.parametrize(
    "check",
    [
        DriverContract.test_every_move_moves_and_stop_stops,
        DriverContract.test_an_action_ends_by_itself,
        DriverContract.test_an_action_that_is_renewed_goes_on,
        DriverContract.test_every_point_counts_as_a_move_and_drives,
        DriverContract.test_leaving_the_context_stops_the_body,
    ],
)
def test_a_body_that_is_late_keeps_the_contract(check: Any) -> None:
    clock = VirtualClock()
    driver = LateDriver(clock)

    def is_moving() -> bool:
        now_s = clock.now_s()
        came = [order for order in driver.orders if order[0] <= now_s]
        return (
            bool(came)
            and came[-1][1] is not Action.STOP
            and (now_s < came[-1][0] + ACTION_TIMEOUT_S)
        )

    check(DriverContract(), DriverCase(driver, clock.advance, is_moving, now_s=clock.now_s))


def test_failures_show_numbers() -> None:
    case = DriverCase(LateDriver(VirtualClock()), lambda s: None, lambda: True)
    with pytest.raises(AssertionError, match="still moves 200 ms after stop"):
        _check_stands(case, "after stop()")
    with pytest.raises(AssertionError, match=r"left drives .0.5, 0.5., not .-0.5, 0.5.: 1 apart"):
        _check_same(Point(0.5, 0.5), Point(-0.5, 0.5), "left")
