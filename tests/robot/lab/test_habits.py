"""The release gate covers what it claims, its runs repeat, and it can fail."""

from __future__ import annotations

import math
import random
from collections import Counter
from typing import Any

import pytest

from robot.lab.chance import difference_by_chance
from robot.lab.experiment import ExperimentSettings
from robot.lab.habits import GATE, LONG_S, RATES_HZ, WORLDS, run_habit
from robot.lab.ready import PILOTS, READY, run_ready
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.task import Result, Task
from robot.lab.trial import drive_by_hand
from robot.simulator.world import world_names
from robot.types import Pose
from tests.kit.sizes import few


def test_every_habit_is_met_in_every_place_at_every_rate() -> None:
    tasks = list(GATE.plan(ExperimentSettings()))
    assert len(tasks) >= 240
    long = {
        (t.params["habit"], t.params["world"], t.params["rate_hz"])
        for t in tasks
        if t.params["teach_s"] == LONG_S
    }
    assert long == {(h, w, r) for h in HABITS for w in WORLDS for r in RATES_HZ}
    assert len({t.params["seed"] for t in tasks}) == len(tasks)
    more = list(GATE.plan(ExperimentSettings(seeds=20)))
    assert len({t.params["seed"] for t in more}) == len(more) >= 480, "other robots"
    assert set(WORLDS) <= set(world_names())
    assert len(HABITS) >= 12
    assert any(t.params["correct_s"] for t in tasks) and not all(
        t.params["correct_s"] for t in tasks
    )


def test_the_readiness_gate_has_forty_varied_pilots() -> None:
    tasks = list(READY.plan(ExperimentSettings()))
    assert len(tasks) == PILOTS == 40
    for name, fewest in (("habit", 12), ("world", 5), ("rate_hz", 3)):
        counts = Counter(t.params[name] for t in tasks)
        assert len(counts) == fewest
        assert max(counts.values()) - min(counts.values()) <= 2


GOOD = {
    "ssd": 1.0,
    "ssd_frequent": 1.0,
    "ssd_alike": 1.0,
    "stuck": False,
    "longest_stay_s": 5.0,
    "longest_push_s": 0.5,
    "asking_share": 0.02,
    "driven_m": 7.0,
    "covered_m2": 0.7,
}


def beside(own: dict[str, Any], pilot: dict[str, Any]) -> Result:
    """Return the result of a robot that drove once by itself, with its pilot's minutes."""
    return {"before": {**own, "teacher": pilot}}


def gate(results: list[Result], tasks: list[Task]) -> dict[str, Any]:
    table = GATE.tables(list(zip(tasks, results, strict=True)))[0]
    return {str(row[0]): row[2] for row in table.rows}


def test_the_gate_says_what_is_wrong() -> None:
    tasks = list(GATE.plan(ExperimentSettings()))
    results: list[Result] = [beside(GOOD, GOOD) for _ in tasks]
    assert gate(results, tasks)["stuck"] == "0.0 %"
    assert gate(results, tasks)["metres"] == "100 %"
    worst = GOOD | {"stuck": True, "longest_push_s": 7.0, "driven_m": 0.0, "asking_share": 1.0}
    results[0] = beside(worst, GOOD)
    told = gate(results, tasks)
    assert told["stuck"] == "0.4 %"
    assert told["longest push"] == 7.0
    assert told["pushes over 1 s"] == 1
    pushed, taught = GOOD | {"longest_push_s": 7.0}, GOOD | {"longest_push_s": 6.0}
    results[0] = beside(pushed, taught)
    assert gate(results, tasks)["pushes over 1 s"] == 0


def test_the_gate_says_how_much_of_a_difference_is_chance() -> None:
    draw = random.Random(1)
    values = [draw.lognormvariate(0.0, 1.0) for _ in range(60)]
    others = [draw.lognormvariate(0.0, 1.0) for _ in range(60)]
    least, most = difference_by_chance(values, others)
    assert least < 0.0 < most < 1.0
    far, farthest = difference_by_chance([value + 1.0 for value in values], others)
    assert (far, farthest) == pytest.approx((least + 1.0, most + 1.0))
    assert difference_by_chance([1.0], [0.5]) == (0.5, 0.5)

    tasks = list(GATE.plan(ExperimentSettings()))
    results: list[Result] = [
        beside(GOOD | {"ssd_alike": 2.0 if task.params["rate_hz"] == 30.0 else 0.5}, GOOD)
        for task in tasks
    ]
    told = gate(results, tasks)
    assert told["median SSD at 30 Hz"] == 2.0
    assert told["its difference by chance"] == "+1.50 to +1.50"


def test_a_robot_taught_by_a_habit_drives_and_the_run_repeats() -> None:
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")

    params = {
        "habit": "irregular",
        "world": "fork",
        "rate_hz": 15.0,
        "seed": 3,
        "teach_s": 25.0,
        "correct_s": 5.0,
        "alone_s": 10.0,
        "reference_s": 60.0,
        "learner": "default-32",
    }
    result = run_habit(params)
    for phase in ("before", "after"):
        assert not result[phase]["stuck"]
        assert result[phase]["longest_push_s"] <= 1.0
        assert result[phase]["driven_m"] > 0.3
        assert result[phase]["teacher"]["driven_m"] > 0.3
    again = run_habit(params)
    del result["timing"], again["timing"]
    assert result == again


@pytest.mark.parametrize("rate_hz", [10.0, 30.0])
def test_a_pilot_is_measured_where_the_robot_began_and_at_its_rate(rate_hz: float) -> None:
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")

    start = Pose(x_m=3.4, y_m=2.2, heading_rad=2.0)
    pilot = HABITS["irregular"].pilot("1")
    drive = drive_by_hand("fork", 2001, pilot, 10.0, rate_hz, start=start)
    first = drive[0].pose
    assert len(drive) == 10 * rate_hz
    assert math.dist((first.x_m, first.y_m), (start.x_m, start.y_m)) < 0.05


_TRIED = {
    "is_ready": True,
    "taught_s": 60.0,
    "agreement": 0.9,
    "asking_share": 0.01,
    "longest_push_s": 0.5,
    "stuck": False,
}


@pytest.mark.parametrize(
    ("limit_s", "in_time_s", "is_ready", "is_told"),
    few([(60.0, 60.0, False, True), (200.0, 40.0, True, True), (200.0, 200.0, True, False)], 1),
)
def test_a_pilot_who_follows_the_advice_gets_a_ready_robot(
    limit_s: float, in_time_s: float, is_ready: bool, is_told: bool
) -> None:
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")

    result = run_ready(
        {
            "habit": "regular",
            "world": "box",
            "rate_hz": 10.0,
            "seed": 1,
            "learner": "default-8",
            "in_time_s": in_time_s,
            "limit_s": limit_s,
        }
    )
    assert result["is_ready"] is is_ready
    assert bool(result["missing"]) is is_told
    assert result["taught_s"] >= 39.0


def test_robots_that_are_ready_late_are_listed_separately() -> None:
    settings = ExperimentSettings()
    tasks = list(READY.plan(settings))[:4]
    runs: list[Result] = [
        {**_TRIED, "tried_s": 180.0, "missing": []},
        {**_TRIED, "tried_s": 180.1, "missing": ["corrected"]},
        {**_TRIED, "tried_s": 480.0, "missing": ["corrected"], "asking_share": 0.06},
        {**_TRIED, "tried_s": 1200.0, "missing": ["pushed"], "is_ready": False},
    ]
    [table] = READY.tables(list(zip(tasks, runs, strict=True)))
    told = table.columns.index("told what is missing")
    too_often = table.columns.index("asked 5 % or more")
    assert [(row[0], row[1], row[told], row[too_often]) for row in table.rows] == [
        ("within four minutes", 2, 1, 0),
        ("later", 1, 1, 1),
        ("never", 1, 1, 0),
    ]
