"""The parts of a robot are released, even if one of them fails."""

from __future__ import annotations

import pytest

from robot.devices.rig import Rig
from robot.errors import CameraError
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, VirtualClock


def test_a_camera_that_cannot_be_closed_leaves_no_body_connected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = VirtualClock()
    driver, camera = ReplayDriver(clock=clock), FakeCamera(clock)
    rig = Rig(driver, camera, make_policy("published-8"), clock)
    rig.start()
    close = camera.stop

    def fail() -> None:
        close()
        raise RuntimeError("the library cannot close it")

    monkeypatch.setattr(camera, "stop", fail)
    with pytest.raises(CameraError, match="cannot close"):
        rig.stop()
    assert not driver.is_connected
