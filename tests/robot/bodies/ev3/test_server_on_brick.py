"""The whole server on an emulated brick: Debian 12 for armel on an ARM926, taught and driven.

`make test-brick` runs this and prints the guest's memory and instructions (a count, which does not
depend on the machine that runs the test).
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Self

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.scripts import ENVIRONMENT
from server.bodies.lean import PUT_OFF
from server.protocol import encode_acknowledgement
from tests.kit.wait import wait_until
from tests.robot.bodies.ev3 import film_camera
from tests.robot.bodies.ev3.armel import Armel, guest_memory_mb
from tests.server.live_robot import Pilot

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(1500)]
MOST_MEMORY_MB = {"bookworm": 36.0, "trixie": 46.0}
"""Limits by release: pydantic 2 and a newer Python need more instructions."""
FRAME_RATE_HZ = 10
SERVE = ("-m", "server.bodies.lean", "serve", "--robot", "ev3", "--brick-root")
LEARNER = os.environ.get("DRIVELESSON_LEARNER", "integer")
UNUSED = (
    "cv2 PIL ssl _ssl _hashlib panda3d zeroconf cryptography segno sklearn ev3dev2.motor "
    "ev3dev2.sensor ev3dev2.display evdev pip robot.simulator robot.lab.baselines"
)


def install_film(folder: Path) -> None:
    """Put a camera and its film of a moving wall into the brick's Python path."""
    shutil.rmtree(folder, ignore_errors=True)
    metadata = folder / "film-1.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: film\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(film_camera.ENTRY_POINT)
    shutil.copy(film_camera.__file__, folder)
    tiles = np.random.default_rng(1).integers(0, 255, (15, 100), dtype=np.uint8)
    wall = tiles.repeat(8, axis=0).repeat(8, axis=1)
    colours = np.full((film_camera.HEIGHT, film_camera.WIDTH), 128, np.uint8)
    views = (wall[:, 6 * i : 6 * i + film_camera.WIDTH] for i in range(100))
    film = (np.dstack([view, colours]).tobytes() for view in views)
    (folder / "film.yuyv").write_bytes(b"".join(film))


class Served:
    """The running server: its process, its address, and the brick that it moves."""

    def __init__(self, armel: Armel, brick: FakeBrick, process: subprocess.Popen[str]) -> None:
        self.armel, self.brick, self.process = armel, brick, process
        assert process.stdout is not None
        said = ""
        while not (match := re.search(r"http://(\S+)", said)):
            line = process.stdout.readline()
            assert line, f"the server ended: {said}"
            said += line
        self.address = f"ws://{match[1]}"

    @property
    def modules(self) -> set[str]:
        said = self.armel.root / "opt/film/film.modules"
        return set(said.read_text().split()) if said.is_file() else set()


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    with serve_on_brick() as served:
        yield served


@contextmanager
def serve_on_brick() -> Iterator[Served]:
    """Serve on an emulated brick with a filmed camera; skipped if an emulator is missing."""
    armel = Armel()
    film = armel.root / "opt/film"
    install_film(film)
    for left_over in ("tmp/brick", "tmp/data"):
        shutil.rmtree(armel.root / left_over, ignore_errors=True)
    env = {**ENVIRONMENT, "PYTHONPATH": "/opt/drivelesson:/opt/film"}
    with FakeBrick(armel.root / "tmp/brick") as brick:
        brick.add_sensor("in4", "lego-ev3-us", 1234, decimals=1)
        words = f"/tmp/brick --camera film --film /opt/film/film.yuyv --frame-rate {FRAME_RATE_HZ}"
        words += f" --learner {LEARNER} --max-nodes 32 --port 0 --data /tmp/data"
        process = subprocess.Popen(
            armel.command(*SERVE, *words.split()), env=env, stdout=subprocess.PIPE, text=True
        )
        try:
            yield Served(armel, brick, process)
        finally:
            process.terminate()
            process.wait(60)
            assert process.stdout is not None
            process.stdout.close()


class Watcher:
    """A client that acknowledges each frame like a page, but draws nothing."""

    def __init__(self, address: str) -> None:
        self.frames: list[bytes] = []
        self._address = address
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._stack = ExitStack()
        self._socket = self._stack.enter_context(
            connect(self._address + "/ws/video", compression=None, open_timeout=120)
        )
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._stack.close()
        self._thread.join(5)

    def _watch(self) -> None:
        with suppress(ConnectionClosed):
            for message in self._socket:
                assert isinstance(message, bytes)
                self.frames.append(message)
                del self.frames[:-2]
                self._socket.send(encode_acknowledgement(self.newest))

    @property
    def newest(self) -> int:
        return int(struct.unpack_from("<I", self.frames[-1], 8)[0]) if self.frames else 0


def cost_of_a_cycle(served: Served, watcher: Watcher, seconds: float = 5.0) -> float:
    """Million guest instructions per frame, of all threads: loop, camera and server."""
    frame, count = watcher.newest, served.armel.instructions()
    time.sleep(seconds)
    return (served.armel.instructions() - count) / (watcher.newest - frame) / 1e6


def keep_at_it(
    pilot: Pilot, mode: str, held: str | None, is_so: Callable[[], bool], within_s: float = 400
) -> None:
    """Drive until a condition holds; `within_s` only ends a test that hangs.

    A busy machine may pause the emulator for longer than a picture may be old; then the robot
    stops, as it must, and is started again.
    """
    deadline_s = time.monotonic() + within_s
    pilot.held = held
    while not is_so():
        assert time.monotonic() < deadline_s, pilot.state
        if pilot.state["mode"] != mode:
            pilot.mode(mode)
        time.sleep(0.1)


def test_a_brick_is_taught_and_drives_by_itself_in_little_memory(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    """The whole test uses one server, because the emulator takes a minute to start."""
    the_robot_is_taught_and_drives_in_36_mb(served, capsys)
    only_modules_that_the_loop_uses_are_imported(served)
    every_move_on_the_brick_was_timed(served)
    a_missing_motor_is_reported_in_one_line(served)


def the_robot_is_taught_and_drives_in_36_mb(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    brick = served.brick
    drive = served.address + "/ws/drive"
    with Watcher(served.address) as watcher, Pilot(drive, open_timeout=120) as pilot:
        said = {"until served": served.armel.instructions() / 1e6}
        pilot.wait_for_state(120, you_are_pilot=True)
        said["standing"] = cost_of_a_cycle(served, watcher)
        keep_at_it(pilot, "train", "forward", lambda: set(brick.speeds().values()) == {360})
        keep_at_it(pilot, "train", "forward", lambda: pilot.state["nodes"] == 32)
        said["learning at 32 nodes"] = cost_of_a_cycle(served, watcher)
        keep_at_it(pilot, "train", "left", lambda: brick.speeds() == {"outB": -90, "outC": 0})
        keep_at_it(pilot, "train", "left", lambda: pilot.state["taught"]["left"] > 10)
        pilot.hold(None)
        brick.wait_until(lambda: not brick.is_moving(), 120)
        keep_at_it(pilot, "autonomous", None, brick.is_moving)
        said["driving at 32 nodes"] = cost_of_a_cycle(served, watcher)
        keep_at_it(pilot, "autonomous", None, lambda: pilot.state["driven_by"] == "robot")
        memory = guest_memory_mb(served.process.pid)
        pilot.mode("stopped")
        brick.wait_until(lambda: not brick.is_moving(), 120)
        state = pilot.state
        picture = watcher.frames[-1]
    assert (picture[1], len(picture)) == (1, 24 + film_camera.SIZE), "YUYV is not converted"
    assert state["learner"] == f"{LEARNER}-32"
    with capsys.disabled():
        print(f"\nmemory at 32 nodes: {memory['resident']:.1f} MB resident (guest pages)")
        for name, count in said.items():
            unit = "" if "until" in name else " a cycle"
            print(f"million instructions for {name}: {count:.1f}{unit}")
    assert memory["resident"] <= MOST_MEMORY_MB[served.armel.release]


def only_modules_that_the_loop_uses_are_imported(served: Served) -> None:
    wait_until(lambda: served.modules)
    modules = served.modules
    assert {"numpy", "fastapi", "ev3dev2", "robot.bodies.ev3.driver"} <= modules
    assert not [name for name in modules if name.startswith(tuple(UNUSED.split()))]
    assert not modules & set(PUT_OFF)


def every_move_on_the_brick_was_timed(served: Served) -> None:
    moves = [command for command in served.brick.commands if command.command.startswith("run")]
    assert moves
    assert {(move.command, move.time_ms) for move in moves} == {("run-timed", 400)}


def a_missing_motor_is_reported_in_one_line(served: Served) -> None:
    done = served.armel.run(*SERVE, "/nowhere", "--port", "0", "--data", "/tmp/data-2")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "no left motor at port outB" in done.stderr
