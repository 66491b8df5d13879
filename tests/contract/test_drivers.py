"""The contract of `robot.testing` on every driver of ours."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.rig.plugins import driver_names
from robot.testing.cases import DriverCase
from robot.testing.driver_contract import DriverContract
from tests.contract.builders import DRIVERS


@pytest.fixture(params=driver_names(own_only=True))
def driver_case(request: pytest.FixtureRequest) -> Iterator[DriverCase]:
    assert request.param in DRIVERS, f"say in builders.py how to build {request.param!r}"
    with DRIVERS[request.param]() as built:
        yield built
        built.driver.disconnect()


class TestEveryDriver(DriverContract):
    pass
