"""The contract of `robot.testing` on every camera of ours."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.devices.plugins import camera_names
from robot.testing.camera_contract import CameraContract
from robot.testing.cases import CameraCase
from tests.contract.builders import CAMERAS


@pytest.fixture(params=camera_names(own_only=True))
def camera_case(request: pytest.FixtureRequest) -> Iterator[CameraCase]:
    assert request.param in CAMERAS, f"say in builders.py how to build {request.param!r}"
    with CAMERAS[request.param]() as built:
        yield built
        built.camera.stop()


class TestEveryCamera(CameraContract):
    pass
