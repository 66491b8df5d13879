"""The content of the agent's archive, and floods of an agent in a separate process.

test_agent.py tests the agent in virtual time. ev3dev's stock image has Python 3.5 and ev3dev2.
"""

from __future__ import annotations

import ast
import io
import socket
import subprocess
import sys
import threading
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from robot.bodies.ev3.agent import callers, wire
from robot.bodies.ev3.archive import agent_sources, make_agent
from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.remote_camera import Ev3RemoteCamera
from robot.bodies.ev3.remote_driver import Ev3RemoteDriver, Ev3RemoteOptions
from robot.bodies.v4l2.camera import UsbCameraOptions
from robot.clock import RealClock
from robot.errors import DriveError
from robot.types import Action
from tests.kit.run import run
from tests.kit.wait import wait_until
from tests.robot.bodies.ev3.fake_video import DEVICE, FakeVideo
from tests.robot.bodies.ev3.virtual_agent import SECRET

MOST_GROWTH_KB = 2048
SOURCES = agent_sources()
VERMIN = (Path(sys.executable).with_name("vermin"), "--no-tips", "-t=3.5-")


def test_the_agents_syntax_and_libraries_are_those_of_python_3_5(tmp_path: Path) -> None:
    done = run(*VERMIN, "--eval-annotations", *SOURCES.values())
    assert done.returncode == 0, done.stdout
    assert "Minimum required versions: " in done.stdout
    newer = tmp_path / "newer.py"
    newer.write_text("x: int = 1\nprint(f'{x}')\n")
    assert run(*VERMIN, newer).returncode != 0, "vermin does not find newer syntax"


def test_the_agent_imports_only_the_standard_library_ev3dev2_and_itself() -> None:
    imported = set[str]()
    for file in SOURCES.values():
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                imported |= {name.name for name in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add(node.module or "")
    carried = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", ".") for name in SOURCES
    }
    outside = {name for name in imported if name.partition(".")[0] not in sys.stdlib_module_names}
    assert outside - carried == {"ev3dev2", "robot.errors"}, "robot.errors is optional"


def test_the_archive_is_whole_and_the_same_each_time_and_its_secret_is_private(
    tmp_path: Path,
) -> None:
    assert make_agent() == make_agent()
    assert set(zipfile.ZipFile(io.BytesIO(make_agent())).namelist()) >= {"__main__.py", *SOURCES}
    archive, secret = tmp_path / "agent.pyz", tmp_path / "secret"
    archive.write_bytes(make_agent())
    secret.write_text(SECRET)
    secret.chmod(0o644)
    done = run(sys.executable, "-I", "-S", archive, "--secret-file", secret, cwd=tmp_path)
    assert done.returncode != 0 and "chmod 600" in done.stderr


@contextmanager
def running_agent(root: Path, folder: Path, env: Mapping[str, str]) -> Iterator[tuple[str, int]]:
    """Yield the address at which the agent of a brick listens, and its process."""
    secret, archive = folder / "secret", folder / "agent.pyz"
    secret.write_text(SECRET)
    secret.chmod(0o600)
    archive.write_bytes(make_agent())
    words = [archive, "--host", "127.0.0.1", "--port", 0, "--secret-file", secret, "--root", root]
    with subprocess.Popen(
        [sys.executable, *map(str, words)], stdout=subprocess.PIPE, text=True, env=env
    ) as process:
        assert process.stdout is not None
        try:
            yield f"127.0.0.1:{process.stdout.readline().split()[-1]}", process.pid
        finally:
            process.terminate()


def memory_kb(pid: int) -> int:
    return int(Path(f"/proc/{pid}/status").read_text().split("VmRSS:")[1].split()[0])


def n_sockets(pid: int) -> int:
    """Count only sockets, because the files of motors and sensors are open only for moments."""
    count = 0
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):  # the file was closed meanwhile
            count += str(link.readlink()).startswith("socket:")
    return count


def gets_in(driver: Ev3RemoteDriver) -> bool:
    """Connect; a flood from the same address may evict a caller."""
    with suppress(DriveError):
        driver.connect()
    return driver.is_connected


@pytest.mark.realtime
def test_a_real_agent_drives_shows_pictures_and_withstands_a_flood(
    real_brick: FakeBrick, tmp_path: Path
) -> None:
    """A thousand callers stay silent; twelve others announce messages of 4 MB, and send them."""
    video = FakeVideo(tmp_path)
    with running_agent(real_brick.root, tmp_path, video.env) as (address, pid):
        driver = Ev3RemoteDriver(Ev3RemoteOptions(brick=address, brick_secret=SECRET))
        camera = Ev3RemoteCamera.for_driver(driver, UsbCameraOptions(device=DEVICE), RealClock())
        with driver, camera:
            wait_until(lambda: camera.latest() is not None)
            video.behave("freeze")
            wait_until(lambda: DEVICE in str(camera.fault))
            video.behave("run")
            wait_until(lambda: camera.fault is None)

        host, port = address.split(":")
        with driver, ExitStack() as stack:
            drive_on(driver, real_brick)
            before_kb, before = memory_kb(pid), n_sockets(pid)
            for _ in range(1010):
                line = stack.enter_context(socket.socket())
                line.setblocking(False)
                with suppress(BlockingIOError):
                    line.connect((host, int(port)))
            drive_on(driver, real_brick)
            assert n_sockets(pid) <= before + callers.MAX_UNJOINED + 1
            assert memory_kb(pid) - before_kb < MOST_GROWTH_KB

        def pour(kind: bytes) -> None:
            body = b"x" * (4 << 20)
            with (
                suppress(OSError),
                socket.create_connection((host, int(port)), timeout=5) as line,
            ):
                line.sendall(wire.HEAD.pack(kind, len(body)) + body)

        wait_until(lambda: gets_in(driver), "the driver is admitted again")
        with driver:
            drive_on(driver, real_brick)
            before_kb = memory_kb(pid)
            senders = [
                threading.Thread(target=pour, args=(kind,)) for kind in 4 * (b"J", b"F", b"Q")
            ]
            for sender in senders:
                sender.start()
            while any(sender.is_alive() for sender in senders):
                assert memory_kb(pid) - before_kb < MOST_GROWTH_KB
            drive_on(driver, real_brick)


def drive_on(driver: Ev3RemoteDriver, brick: FakeBrick) -> None:
    driver.send_action(Action.FORWARD)
    brick.wait_until(brick.is_moving)
