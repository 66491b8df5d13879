"""The whole server on an emulated brick: Debian 12 for armel on an ARM926, taught and driven.

`make test-brick` runs this and prints the guest's memory and instructions (a count, which does not
depend on the machine that runs the test).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from robot.bodies.ev3.scripts import ENVIRONMENT
from server.bodies.lean import PUT_OFF
from tests.kit.wait import wait_until
from tests.robot.bodies.ev3.armel import Armel, guest_memory_mb
from tests.server.live_robot import Pilot

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(1500)]
MOST_MEMORY_MB = {"bookworm": 36.0, "trixie": 46.0}
"""Limits by release: pydantic 2 and a newer Python need more of each second."""
SERVE = ("-m", "server.bodies.lean", "serve", "--robot", "ev3", "--brick-root")
LEARNER = os.environ.get("DRIVELESSON_LEARNER", "integer")
UNUSED = (
    "cv2 PIL ssl _ssl _hashlib panda3d zeroconf cryptography segno sklearn ev3dev2.motor "
    "ev3dev2.sensor ev3dev2.display evdev pip robot.simulator robot.lab.baselines"
)


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

    def pilot(self) -> Pilot:
        """Return a pilot who draws nothing, but acknowledges each frame, like a page."""
        url = self.address + "/ws/drive"
        return Pilot(url, sees=True, open_timeout=120, ping_interval=None)


@contextmanager
def serve_on_brick() -> Iterator[Served]:
    """Serve on an emulated brick with a filmed camera; skipped if an emulator is missing."""
    armel = Armel()
    for left_over in ("tmp/brick", "tmp/data"):
        shutil.rmtree(armel.root / left_over, ignore_errors=True)
    env = {**ENVIRONMENT, "PYTHONPATH": "/opt/drivelesson:/opt/film"}
    with FakeBrick(armel.root / "tmp/brick") as brick:
        brick.add_sensor("in4", "lego-ev3-us", 1234, decimals=1)
        words = f"/tmp/brick --camera film --learner {LEARNER} --max-nodes 32 --port 0"
        command = armel.command(*SERVE, *words.split(), "--data", "/tmp/data")
        with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) as process:
            try:
                yield Served(armel, brick, process)
            finally:
                process.terminate()


def cost_of_a_cycle(served: Served, pilot: Pilot, seconds: float = 5.0) -> float:
    """Million guest instructions per frame, of all threads: loop, camera and server."""
    frame, count = pilot.picture, served.armel.instructions()
    time.sleep(seconds)
    assert frame is not None and pilot.picture is not None
    return (served.armel.instructions() - count) / (pilot.picture - frame) / 1e6


def keep_at_it(pilot: Pilot, mode: str, held: str | None, is_so: Callable[[], bool]) -> None:
    """Drive until a condition holds.

    A busy machine may pause the emulator for longer than a picture may be old; then the robot
    stops, as it must, and is started again.
    """
    deadline_s = time.monotonic() + 400  # only ends a test that hangs
    pilot.held = held
    while not is_so():
        assert time.monotonic() < deadline_s, pilot.state
        if pilot.state["mode"] != mode:
            pilot.mode(mode)
        time.sleep(0.1)


def test_a_brick_is_taught_and_drives_by_itself_in_little_memory(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One server is used for all of this, because the emulator takes a minute to start."""
    with serve_on_brick() as served:
        it_is_taught_and_drives_in_36_mb(served, capsys)
        nothing_is_imported_that_the_loop_does_not_use(served)
        moves = [one for one in served.brick.commands if one.command.startswith("run")]
        assert {(move.command, move.time_ms) for move in moves} == {("run-timed", 400)}
        done = served.armel.run(*SERVE, "/nowhere", "--port", "0", "--data", "/tmp/data-2")
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        assert "no left motor at port outB" in done.stderr


def it_is_taught_and_drives_in_36_mb(served: Served, capsys: pytest.CaptureFixture[str]) -> None:
    brick = served.brick
    with served.pilot() as pilot:
        said = {"until served": served.armel.instructions() / 1e6}
        pilot.wait_for_state(120, you_are_pilot=True)
        wait_until(lambda: pilot.picture is not None)
        said["standing"] = cost_of_a_cycle(served, pilot)
        keep_at_it(pilot, "train", "forward", lambda: set(brick.speeds().values()) == {360})
        keep_at_it(pilot, "train", "forward", lambda: pilot.state["nodes"] == 32)
        said["learning at 32 nodes"] = cost_of_a_cycle(served, pilot)
        keep_at_it(pilot, "train", "left", lambda: brick.speeds() == {"outB": -90, "outC": 0})
        keep_at_it(pilot, "train", "left", lambda: pilot.state["taught"]["left"] > 10)
        pilot.hold(None)
        brick.wait_until(lambda: not brick.is_moving(), 120)
        keep_at_it(pilot, "autonomous", None, brick.is_moving)
        said["driving at 32 nodes"] = cost_of_a_cycle(served, pilot)
        keep_at_it(pilot, "autonomous", None, lambda: pilot.state["driven_by"] == "robot")
        memory_mb = guest_memory_mb(served.process.pid)
        pilot.mode("stopped")
        brick.wait_until(lambda: not brick.is_moving(), 120)
        assert pilot.state["learner"] == f"{LEARNER}-32"
    with capsys.disabled():
        print(f"\nmemory at 32 nodes: {memory_mb:.1f} MB resident (guest pages)")
        for name, count in said.items():
            unit = "" if "until" in name else " a cycle"
            print(f"million instructions, {name}: {count:.1f}{unit}")
    assert memory_mb <= MOST_MEMORY_MB[served.armel.release]


def nothing_is_imported_that_the_loop_does_not_use(served: Served) -> None:
    said = served.armel.root / "opt/film/film.modules"
    modules = set(said.read_text().split())
    assert {"numpy", "fastapi", "ev3dev2", "robot.bodies.ev3.driver"} <= modules
    assert not [name for name in modules if name.startswith(tuple(UNUSED.split()))]
    assert not modules & set(PUT_OFF)
