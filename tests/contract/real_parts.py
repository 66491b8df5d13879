"""The drivers and cameras also fulfil the contract with real sockets, processes and libraries.

These checks show only that the real parts work. The suites in virtual time check the whole contract
and all times.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from typing import Any

import pytest

from robot.bodies.remote.driver import ReportingDriver
from robot.camera import Camera
from robot.driver import Driver
from robot.testing.camera_contract import CameraContract
from robot.testing.cases import CameraCase, DriverCase
from robot.testing.driver_contract import DriverContract

_ASKED_AT_MOST = 20
"""A body that sends no more messages after its connection was cut."""
Check = Callable[[DriverContract, DriverCase], None]
WHOLE: tuple[Check, ...] = tuple(
    check for name, check in vars(DriverContract).items() if name.startswith("test_")
)
SHORT: tuple[Check, ...] = (
    DriverContract.test_every_move_moves_and_stop_stops,
    DriverContract.test_an_action_ends_by_itself,
    DriverContract.test_it_leaves_nothing_behind,
    DriverContract.test_a_body_whose_line_is_cut_stands_and_the_driver_says_so,
)
"""Check real bodies that have no suite in virtual time."""


def on_a_busy_machine(driver: Driver, is_moving: Callable[[], bool], **more: Any) -> DriverCase:
    """Return a case over real sockets, whose speed is not checked."""
    return DriverCase(driver, time.sleep, is_moving, budget_s=5.0, **more)


def check_real_driver(driver: Driver, is_moving: Callable[[], bool]) -> None:
    """Check that a driver of the suite in virtual time moves and stops its real body."""
    case = on_a_busy_machine(driver, is_moving)
    DriverContract().test_every_move_moves_and_stop_stops(case)
    DriverContract().test_it_leaves_nothing_behind(case)


def as_reported(driver: ReportingDriver, is_moving: Callable[[], bool]) -> Callable[[], bool]:
    """Return whether a body moves after it has reported the last order; motion before that does not
    count."""

    def moves_now() -> bool:
        for _ in range(_ASKED_AT_MOST):
            report = driver._report
            if report is None or report.seq >= driver._seq:
                break
            driver._exchange(driver.hello)
        return is_moving()

    return moves_now


def check_real_case(
    make: Callable[[], AbstractContextManager[DriverCase]], checks: Iterable[Check]
) -> None:
    """Run some checks of the contract, each with a new body."""
    for check in checks:
        # If a check does not apply to this body, the test must go on with the next check.
        with make() as case, contextlib.suppress(pytest.skip.Exception):
            check(DriverContract(), case)


def check_real_camera(camera: Camera) -> None:
    """Check that a camera of the suite in virtual time shows the pictures of its real source."""
    CameraContract().test_frames_count_up_and_are_stamped_by_the_clock(CameraCase(camera))
    CameraContract().test_it_leaves_no_thread_behind(CameraCase(camera))
