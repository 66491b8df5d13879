"""Through how many modules one taught tick runs: who reads the loop has to follow it so far."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import robot
from robot.types import Action, Mode
from tests.robot.bench_robot import BenchRobot

MODULES, CHANGES = 25, 80
"""Measured are 26 and 83; 38 and 137 before the parts of a policy had one interface."""
LOOSE = 1.1
ROOT = Path(robot.__file__).parent


def test_one_taught_tick_runs_through_few_modules() -> None:
    bench = BenchRobot("default-32")
    bench.start(Mode.TRAIN)
    moves = [Action.FORWARD, Action.LEFT, Action.RIGHT]
    for i in range(60):
        bench.step(scene=i % 5, held=moves[i // 10 % 3], seconds=0.1)
    bench.clock.sleep(0.1)
    bench.camera.show(3)
    bench.hold(moves[2])
    called: list[Path] = []

    def note(frame: Any, event: str, _: object) -> None:
        file = Path(frame.f_code.co_filename)
        if event == "call" and file.is_relative_to(ROOT) and ROOT / "testing" not in file.parents:
            called.append(file)

    taught = dict(bench.loop.state.taught)
    sys.setprofile(note)
    try:
        bench.tick()
    finally:
        sys.setprofile(None)
    assert bench.loop.state.taught != taught, "the tick was taught"
    changes = sum(one != other for one, other in pairwise(called))
    print(f"one taught tick: {len(set(called))} modules, {changes} changes of module")
    assert len(set(called)) <= LOOSE * MODULES
    assert changes <= LOOSE * CHANGES
