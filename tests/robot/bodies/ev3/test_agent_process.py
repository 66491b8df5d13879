"""The agent in a separate process works; test_agent.py tests its times."""

from __future__ import annotations

import socket
import sys
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from robot.bodies.ev3.agent import callers, wire
from robot.bodies.ev3.archive import make_agent
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.handshake import join
from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.v4l2.camera import UsbCameraOptions
from robot.clock import RealClock
from robot.errors import DriveError
from robot.types import Action
from tests.kit.run import run
from tests.kit.wait import wait_until
from tests.robot.bodies.ev3.fake_video import DEVICE, QUICK, FakeVideo
from tests.robot.bodies.ev3.running_agent import SECRET, RunningAgent

MOST_GROWTH_KB = 2048


def host_port(address: str) -> tuple[str, int]:
    host, port = address.split(":")
    return host, int(port)


def memory_kb(agent: RunningAgent) -> int:
    status = Path(f"/proc/{agent.process.pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0])


def sockets(agent: RunningAgent) -> int:
    """Count only its sockets, because files of motors and sensors are open for moments."""
    count = 0
    for link in Path(f"/proc/{agent.process.pid}/fd").iterdir():
        with suppress(OSError):  # closed meanwhile
            count += str(link.readlink()).startswith("socket:")
    return count


def connect(address: str, stack: ExitStack) -> socket.socket:
    line = stack.enter_context(socket.socket())
    line.setblocking(False)
    with suppress(BlockingIOError):
        line.connect(host_port(address))
    return line


def make_driver(address: str) -> Ev3RemoteDriver:
    return Ev3RemoteDriver(Ev3RemoteOptions(brick=address, brick_secret=SECRET))


def drive_on(driver: Ev3RemoteDriver, brick: FakeBrick) -> None:
    driver.send_action(Action.FORWARD)
    brick.wait_until(brick.is_moving)


def join_patiently(address: str) -> None:
    """Join, with as many tries as needed: a flood from the same address may evict one."""
    for _ in range(50):
        try:
            join(address, SECRET).line.close()
            return
        except DriveError:
            continue
    raise AssertionError("nobody gets in any more")


@pytest.mark.realtime
def test_a_real_agent_drives_shows_pictures_and_withstands_foreign_callers(
    real_brick: FakeBrick, tmp_path: Path
) -> None:
    the_camera_comes_newest_first_and_its_faults_are_said(real_brick, tmp_path)
    with RunningAgent(real_brick.root, tmp_path) as agent:
        a_thousand_idle_connections_are_nothing(real_brick, agent)
        twelve_strangers_with_four_megabytes_each_get_no_memory(real_brick, agent)


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


def a_thousand_idle_connections_are_nothing(brick: FakeBrick, agent: RunningAgent) -> None:
    with make_driver(agent.address) as driver, ExitStack() as stack:
        drive_on(driver, brick)
        before_kb, before = memory_kb(agent), sockets(agent)
        for _ in range(1010):
            connect(agent.address, stack)
        drive_on(driver, brick)
        assert agent.process.poll() is None
        assert sockets(agent) <= before + callers.MAX_UNJOINED + 1
        assert memory_kb(agent) - before_kb < MOST_GROWTH_KB
    join_patiently(agent.address)


def twelve_strangers_with_four_megabytes_each_get_no_memory(
    brick: FakeBrick, agent: RunningAgent
) -> None:
    body = b"x" * (4 << 20)
    kinds = (b"J", b"F", b"Q")
    with make_driver(agent.address) as driver:
        drive_on(driver, brick)
        before_kb = memory_kb(agent)

        def pour(kind: bytes) -> None:
            with (
                suppress(OSError),
                socket.create_connection(host_port(agent.address), timeout=5) as line,
            ):
                line.sendall(wire.HEAD.pack(kind, len(body)) + body)

        senders = [threading.Thread(target=pour, args=(kinds[n % 3],)) for n in range(12)]
        for sender in senders:
            sender.start()
        most_kb = before_kb
        while any(sender.is_alive() for sender in senders):
            most_kb = max(most_kb, memory_kb(agent))
        assert most_kb - before_kb < MOST_GROWTH_KB
        drive_on(driver, brick)


def test_other_users_cannot_read_the_secret(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_text(SECRET)
    secret.chmod(0o644)
    archive = tmp_path / "agent.pyz"
    archive.write_bytes(make_agent())
    done = run(sys.executable, archive, "--secret-file", secret)
    assert done.returncode != 0
    assert "chmod 600" in done.stderr
