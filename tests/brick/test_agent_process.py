"""The agent as a process of its own: it works. How soon is judged in test_agent.py."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from robot.brick.archive import make_agent
from robot.cameras.ev3_remote import Ev3RemoteCamera
from robot.capture.options import UsbCameraOptions
from robot.clock import RealClock
from robot.drivers.ev3_remote import Ev3RemoteDriver, Ev3RemoteOptions
from robot.errors import DriveError
from robot.testing.brick import FakeBrick
from robot.types import Action
from tests.brick.fake_video import DEVICE, QUICK, FakeVideo
from tests.brick.running_agent import SECRET, RunningAgent


def make_driver(address: str) -> Ev3RemoteDriver:
    return Ev3RemoteDriver(Ev3RemoteOptions(brick=address, brick_secret=SECRET))


def wait_until(is_so: Callable[[], bool], timeout_s: float = 30.0) -> None:
    started_s = time.monotonic()
    while not is_so():
        assert time.monotonic() - started_s < timeout_s, "waited in vain"
        time.sleep(0.005)


@pytest.mark.realtime
def test_a_process_drives_shows_and_comes_back(brick: FakeBrick, tmp_path: Path) -> None:
    the_camera_comes_newest_first_and_its_faults_are_said(brick, tmp_path)
    a_line_that_was_lost_is_said_and_joined_again(brick, tmp_path)


def a_line_that_was_lost_is_said_and_joined_again(brick: FakeBrick, tmp_path: Path) -> None:
    first = RunningAgent(brick.root, tmp_path)
    port = first.address.split(":")[1]
    with first, make_driver(first.address) as driver:
        driver.send_action(Action.FORWARD)
        first.process.kill()
        first.process.wait()

        def is_said() -> bool:
            try:
                driver.send_action(Action.FORWARD)
            except DriveError as error:
                return "brick at 127.0.0.1" in str(error)
            return False

        wait_until(is_said)
        with RunningAgent(brick.root, tmp_path, port=port):

            def drives() -> bool:
                try:
                    return driver.send_action(Action.FORWARD) is Action.FORWARD
                except DriveError:
                    return False

            wait_until(drives)
            brick.wait_until(brick.is_moving)


def the_camera_comes_newest_first_and_its_faults_are_said(brick: FakeBrick, tmp_path: Path) -> None:
    video = FakeVideo(tmp_path, QUICK)
    options = UsbCameraOptions(device=DEVICE)
    with RunningAgent(brick.root, tmp_path, video.env) as running:
        driver = make_driver(running.address)
        camera = Ev3RemoteCamera.for_driver(driver, options, RealClock())
        with driver, camera:
            wait_until(lambda: camera.latest() is not None)
            video.behave("freeze")
            wait_until(lambda: camera.fault is not None)
            wait_until(lambda: DEVICE in str(camera.fault))
            video.behave("run")
            wait_until(lambda: camera.fault is None)


def test_others_may_not_read_the_secret(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text(SECRET)
    secret.chmod(0o644)
    archive = tmp_path / "agent.pyz"
    archive.write_bytes(make_agent())
    done = subprocess.run(
        [sys.executable, archive, "--secret-file", secret],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "chmod 600" in done.stderr
