"""Counts the modules and lines that a taught tick runs, and that a reader has to follow.

The test drives the simulator by a page's messages, with all listeners that `drivelesson`
subscribes. The path begins with a picture and a command, and ends when disk and pages have the
tick.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import pytest

import robot
import server
from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from tests.server.virtual_server import VirtualServer

pytest.importorskip("panda3d")

from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions

MODULES, CHANGES = 26, 75
LINES = 5_900
"""Limit; 5,801 lines were measured. More than two thirds run in a tick, or are declarations and
docstrings; most other lines make, save, edit or stop the same objects."""
ROOTS = Path(robot.__file__).parent, Path(server.__file__).parent
TESTING = ROOTS[0] / "testing"


@pytest.fixture
def served(tmp_path):
    clock = VirtualClock(100.0)
    body = SimDriver(SimOptions())
    camera = SimCamera(body, SimCameraOptions(), clock)
    with VirtualServer(
        rig=Rig(body, camera, make_policy("default-32"), clock), data=tmp_path
    ) as it:
        yield it


def test_one_taught_tick_runs_through_few_modules(served):
    loop = served.rig.loop
    called: list[Path] = []

    def note(frame, event, _):
        file = Path(frame.f_code.co_filename)
        is_ours = any(file.is_relative_to(root) for root in ROOTS) and TESTING not in file.parents
        if event == "call" and is_ours:
            called.append(file)

    with served.pilot() as pilot:
        pilot.mode("train")
        for held in ("forward", "left", "right", "left"):
            pilot.hold(held)
            served.forward(1.5)
        tick = loop.tick

        def traced(now_s):
            taught = loop.state.taught
            sys.setprofile(note)
            try:
                return tick(now_s)
            finally:
                sys.setprofile(None)
                if loop.state.frame is None or loop.state.taught == taught:
                    called.clear()  # this tick taught nothing
                else:
                    loop.tick = tick

        loop.tick = traced
        served.forward(1.5)
    assert called, "no tick taught an example"
    modules = set(called)
    changes = sum(one != other for one, other in pairwise(called))
    lines = sum(len(file.read_text("utf-8").splitlines()) for file in modules)
    walk = (ROOTS[0].parent / "docs/explanation/architecture.md").read_text("utf-8")
    named = {file: file.relative_to(ROOTS[0].parent).as_posix() for file in modules}
    assert [name for name in named.values() if f"`{name}`" not in walk] == []
    print(f"one taught tick: {len(modules)} modules, {changes} changes of module, {lines} lines")
    assert len(modules) <= MODULES
    assert changes <= CHANGES
    assert lines <= LINES
