"""The contract of `robot.testing`, for each of our drivers."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.devices.plugins import DRIVERS as GROUP
from robot.testing.cases import DriverCase
from robot.testing.driver_contract import DriverContract
from tests.contract.driver_cases import DRIVERS
from tests.own_plugins import own_plugins

OVER_REAL_LINES = {"lego-education"}
"""A third-party library with threads of its own is tested by real_parts.py instead."""


def test_no_driver_is_left_out() -> None:
    missing = set(own_plugins(GROUP)) - OVER_REAL_LINES - set(DRIVERS)
    assert not missing, f"say in driver_cases.py how to build {missing}"


@pytest.fixture(params=sorted(DRIVERS))
def driver_case(request: pytest.FixtureRequest) -> Iterator[DriverCase]:
    with DRIVERS[request.param]() as built:
        yield built
        built.driver.disconnect()


class TestEveryDriver(DriverContract):
    pass
