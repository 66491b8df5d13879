"""The contract of `robot.testing`, for each of our cameras."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.devices.plugins import CAMERAS as GROUP
from robot.testing.camera_contract import CameraContract
from robot.testing.cases import CameraCase
from tests.contract.camera_cases import CAMERAS
from tests.own_plugins import own_plugins


@pytest.fixture(params=own_plugins(GROUP))
def camera_case(request: pytest.FixtureRequest) -> Iterator[CameraCase]:
    assert request.param in CAMERAS, f"say in camera_cases.py how to build {request.param!r}"
    with CAMERAS[request.param]() as built:
        yield built
        built.camera.stop()


class TestEveryCamera(CameraContract):
    pass
