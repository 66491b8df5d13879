"""The release gate covers what it claims, its runs repeat, and it can fail."""

import math
from collections import Counter
from typing import Any

import pytest

from robot.lab.experiment import ExperimentSettings
from robot.lab.habits import GATE, LONG_S, RATES_HZ, WORLDS, run_habit
from robot.lab.ready import PILOTS, READY, run_ready
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.task import Result, Task
from robot.lab.trial import drive_by_hand
from robot.simulator.world import world_names
from robot.types import Pose
from tests.kit.sizes import few


def test_every_habit_is_met_in_every_place_at_every_rate():
    tasks = list(GATE.plan(ExperimentSettings()))
    long = [task.params for task in tasks if task.params["teach_s"] == LONG_S]
    met = {(own["habit"], own["world"], own["rate_hz"]) for own in long}
    assert met == {(h, w, r) for h in HABITS for w in WORLDS for r in RATES_HZ}
    assert {*WORLDS} <= {*world_names()} and len(HABITS) >= 12
    assert 0 < sum(task.params["correct_s"] > 0 for task in tasks) < len(tasks)
    for settings, fewest in ((ExperimentSettings(), 240), (ExperimentSettings(seeds=20), 480)):
        seeds = [task.params["seed"] for task in GATE.plan(settings)]
        assert len({*seeds}) == len(seeds) >= fewest, "each robot is another one"
    ready = list(READY.plan(ExperimentSettings()))
    assert len(ready) == PILOTS
    for name in ("habit", "world", "rate_hz"):
        counts = Counter(task.params[name] for task in ready)
        assert max(counts.values()) - min(counts.values()) <= 2, "the pilots are varied"


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


def gate(first: dict[str, Any], pilot: dict[str, Any] = GOOD) -> dict[str, Any]:
    """Return the gate's rows, if one robot and its pilot drove like this, and all others well.

    Robots with thirty pictures a second differ more from their pilots.
    """
    tasks: list[Task] = list(GATE.plan(ExperimentSettings()))
    ssds = (2.0 if task.params["rate_hz"] == 30.0 else 0.5 for task in tasks)
    results: list[Result] = [{"before": GOOD | {"ssd_alike": ssd, "teacher": GOOD}} for ssd in ssds]
    results[0] = {"before": first | {"teacher": pilot}}
    table = GATE.tables(list(zip(tasks, results, strict=True)))[0]
    return {str(row[0]): row[2] for row in table.rows}


def test_the_gate_says_what_is_wrong_and_how_much_is_chance():
    good = gate(GOOD)
    assert (good["stuck"], good["metres"], good["pushes over 1 s"]) == ("0.0 %", "100 %", 0)
    assert good["median SSD at 30 Hz"] == 2.0
    assert good["its difference by chance"] == "+1.50 to +1.50"
    bad = gate(GOOD | {"stuck": True, "longest_push_s": 7.0})
    assert (bad["stuck"], bad["longest push"], bad["pushes over 1 s"]) == ("0.4 %", 7.0, 1)
    taught = GOOD | {"longest_push_s": 6.0}
    assert gate(GOOD | {"longest_push_s": 7.0}, taught)["pushes over 1 s"] == 0


def test_a_robot_taught_by_a_habit_drives_and_the_run_repeats():
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
    times = {"teach_s": 25.0, "correct_s": 5.0, "alone_s": 10.0, "reference_s": 60.0}
    robot = {"world": "fork", "rate_hz": 15.0, "seed": 3, "learner": "default-32"}
    result, again = (run_habit({"habit": "irregular", **times, **robot}) for _ in range(2))
    for phase in ("before", "after"):
        assert not result[phase]["stuck"]
        assert result[phase]["longest_push_s"] <= 1.0
        assert result[phase]["driven_m"] > 0.3
        assert result[phase]["teacher"]["driven_m"] > 0.3
    del result["timing"], again["timing"]
    assert result == again


def test_a_pilot_is_measured_where_the_robot_began_and_at_its_rate():
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
    start = Pose(x_m=3.4, y_m=2.2, heading_rad=2.0)
    drive = drive_by_hand("fork", 2001, HABITS["irregular"].pilot("1"), 10.0, 30.0, start=start)
    first = drive[0].pose
    assert len(drive) == 300
    assert math.dist((first.x_m, first.y_m), (start.x_m, start.y_m)) < 0.05


@pytest.mark.parametrize(
    ("limit_s", "in_time_s", "is_ready", "is_told"),
    few([(60.0, 60.0, False, True), (200.0, 40.0, True, True), (200.0, 200.0, True, False)], 1),
)
def test_a_pilot_who_follows_the_advice_gets_a_ready_robot(limit_s, in_time_s, is_ready, is_told):
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
    robot = {"world": "box", "rate_hz": 10.0, "seed": 1, "learner": "default-8"}
    times = {"in_time_s": in_time_s, "limit_s": limit_s}
    result = run_ready({"habit": "regular", **robot, **times})
    assert (result["is_ready"], bool(result["missing"])) == (is_ready, is_told)
    assert result["taught_s"] >= 39.0
