"""Figure 5 on a robot with wheels: a brick made of files, an agent on it, a made-up camera."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.experiments.cycles import run_cycles
from robot.testing.brick import FakeBrick
from tests.brick.fake_video import DEVICE, FakeVideo
from tests.brick.running_agent import SECRET, RunningAgent


@pytest.mark.realtime
def test_cycles_are_timed_on_a_brick_its_camera_and_wheels_included(tmp_path: Path) -> None:
    video = FakeVideo(tmp_path)
    with FakeBrick(tmp_path / "brick") as brick:
        with RunningAgent(brick.root, tmp_path, video.env) as agent:
            options = {"brick": agent.address, "brick_secret": SECRET, "device": DEVICE}
            result = run_cycles(
                {"learner": "published-4", "robot": "ev3-remote", "cycles": 20, "options": options}
            )
        brick.catch_up()
        assert not brick.is_moving(), "the wheels stand when it is over"
    timing = result["timing"]
    assert timing["nodes"] == 4
    assert 1 < timing["applying_hz"] < 100, "the camera sets the pace"
    assert 1 < timing["learning_hz"] < 100
