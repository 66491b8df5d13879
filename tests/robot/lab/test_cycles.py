"""Figure 5 on a robot with wheels: a brick made of files, an agent on it, a simulated camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.v4l2.camera import UsbCameraOptions
from robot.devices.driver_thread import DriverThread
from robot.devices.rig import Rig
from robot.lab import figure5
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from tests.robot.bodies.ev3.virtual_agent import MadeUpCamera, VirtualAgent


def test_cycles_are_timed_on_a_brick_its_camera_and_wheels_included(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In virtual time only this takes time: the agent looks for a picture every 50 ms."""
    clock, camera = VirtualClock(100.0), MadeUpCamera()
    camera.width, camera.height = 160, 120
    with (
        FakeBrick(tmp_path / "brick", clock=clock) as brick,
        VirtualAgent(brick, open_camera=camera.open) as agent,
    ):

        def build_rig(robot: str, *, options: dict[str, Any]) -> Rig:
            assert (robot, options) == ("ev3-remote", {"brick": agent.address})
            driver = Ev3RemoteDriver(Ev3RemoteOptions(**options), agent.link())
            eye = Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(), clock)
            return Rig(DriverThread(driver, clock), eye, make_policy("default-32"), clock)

        monkeypatch.setattr(figure5, "build_rig", build_rig)
        params = {"learner": "published-4", "robot": "ev3-remote", "cycles": 20}
        result = figure5.run_cycles(params | {"options": {"brick": agent.address}})
        brick.catch_up()
        assert [c.command for c in brick.commands].count("run-timed") >= 40, "both turned"
        assert not brick.is_moving(), "the wheels stand when it is over"
    timing = result["timing"]
    assert timing["nodes"] == 4
    assert timing["applying_hz"] == pytest.approx(20, rel=0.05), "the camera sets the pace"
    assert timing["learning_hz"] == pytest.approx(20, rel=0.05)
