"""Whole lessons of experiments, ideas from files, and the release gate."""

import math
from collections import Counter
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from robot.devices.rig import Rig
from robot.driver import Pose
from robot.errors import ConfigurationError
from robot.lab import figure5, proportional
from robot.lab.experiment import ExperimentSettings
from robot.lab.figure3 import FIGURE3
from robot.lab.habits import GATE, LONG_S, RATES_HZ, WORLDS, run_habit
from robot.lab.ideas import make_learner, make_teacher, make_trial
from robot.lab.lessons import run_lesson
from robot.lab.ready import PILOTS, READY, run_ready
from robot.lab.simulated_pilots.habits import HABITS
from robot.lab.simulated_pilots.teachers import SonarController
from robot.lab.task import Result, Task
from robot.lab.trial import FRAME_RATE_HZ, drive_by_hand
from robot.policy.registry import make_policy
from robot.simulator.world import world_names
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import DEFAULT_MOVES, Action, DrivenBy, Mode
from tests.kit.sizes import few
from tests.robot.footage import write_footage

BOX = {"world": "box", "moves": ("forward", "left"), "teacher": "usual", "seed": 1}
HOW_TO = Path(__file__).parents[3] / "docs" / "howto" / "try-an-idea.md"


def examples() -> list[str]:
    """The Python examples of the how-to, which readers copy."""
    parts = HOW_TO.read_text("utf-8").split("```python\n")[1:]
    return [part.split("```")[0] for part in parts]


def test_the_pilot_teaches_and_then_the_robot_drives_and_learns_nothing_unsupervised():
    """`test_runner` tests that the same seed gives the same numbers."""
    pytest.importorskip("panda3d.core", reason="the simulator's renderer is not installed")
    with make_trial(BOX | {"learner": "published-8"}) as trial:
        taught = trial.drive(Mode.TRAIN, 12.0)
        lessons = trial.loop.history.taught.total()
        alone = trial.drive(Mode.AUTONOMOUS, 10.0, supervised=False)
        assert trial.loop.history.taught.total() == lessons >= 100
        assert trial.policy.n_nodes == 8
    assert len(taught) == 12 * FRAME_RATE_HZ
    assert {moment.driven_by for moment in taught[5:]} == {DrivenBy.PILOT}
    assert {moment.driven_by for moment in alone} == {DrivenBy.ROBOT}


def test_a_proportional_pilot_is_smoother_than_one_reduced_to_moves():
    plan = list(proportional.PROPORTIONAL.plan(ExperimentSettings(quick=True)))
    assert [task.params["way"] for task in plan] == list(proportional.WAYS)
    short = {"TEACH_S": 20.0, "CORRECT_S": 1.0, "ALONE_S": 3.0, "_MINUTES": 1}
    with mock.patch.multiple(proportional, **short):
        runs = [(Task(task.run, task.params), task.run(task.params)) for task in plan[:2]]
    degrees, cut = (result["teacher"]["steering_per_s"] for _, result in runs)
    assert 0.0 < degrees < 0.5 * cut
    for table in proportional.PROPORTIONAL.tables(runs):
        assert [row[0] for row in table.rows] == ["degrees", "cut to moves"]
        assert {len(row) for row in table.rows} == {len(table.columns)}


def test_the_ideas_of_the_how_to_enter_an_experiment(tmp_path):
    learner, teacher = examples()
    assert sum(bool(line.strip()) for line in learner.splitlines()) <= 20
    (tmp_path / "idea.py").write_text(learner)
    (tmp_path / "timid.py").write_text(teacher)
    ideas = {"learner": f"{tmp_path}/idea.py:LastFrames", "teacher": f"{tmp_path}/timid.py:Timid"}
    result = run_lesson(BOX | ideas | {"teach_s": 20.0, "alone_s": 5.0, "reference_s": 5.0})
    assert result["taught"]["agreement"] > 0.5
    assert 0.0 < result["before"]["ssd"] < 100.0

    for seed, name in enumerate(("hall_A.npz", "hall_B.npz")):
        write_footage(tmp_path / name, seed=seed)
    idea = ideas["learner"]
    settings = ExperimentSettings(quick=True, learners=(idea,), recordings=str(tmp_path))
    tasks = [task for task in FIGURE3.plan(settings) if task.kind == "recorded_footage"]
    assert [task.params["learner"] for task in tasks] == [idea, idea]
    assert 0.5 < tasks[0].run(tasks[0].params)["accuracy"] <= 1.0


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no attribute 'Name'"),
        ("1 / 0", "ZeroDivisionError"),
        ("class Name: pass", "neither a Policy nor a Learner"),
    ],
)
def test_a_broken_idea_is_one_clear_error(tmp_path, text, complaint):
    file = tmp_path / "idea.py"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=complaint) as caught:
        make_learner(f"{file}:Name", DEFAULT_MOVES)
    assert str(file) in str(caught.value)


def test_learners_and_teachers_are_found_by_name_and_an_unknown_one_lists_them():
    assert make_learner("published-8", DEFAULT_MOVES).name == "published-8"
    assert isinstance(make_teacher("sonar", DEFAULT_MOVES), SonarController)
    for name in ("usual", "early", "late", "wide", "habit"):
        make_teacher(name, DEFAULT_MOVES)
    with pytest.raises(ConfigurationError, match=r"sonar, .*usual"):
        make_teacher("nobody", DEFAULT_MOVES)
    with pytest.raises(ConfigurationError, match=r"no file .*gone\.py"):
        make_teacher("gone.py:Name", DEFAULT_MOVES)
    with pytest.raises(ConfigurationError, match="published"):
        make_learner("nobody-7", DEFAULT_MOVES)


def test_cycles_are_timed_on_a_robot_its_camera_and_wheels_included(monkeypatch):
    """In virtual time, a cycle takes only the 50 ms of the camera's period."""
    clock = VirtualClock(100.0)
    driver, camera = FakeDriver(clock=clock), FakeCamera(clock, rate_hz=20.0)
    rig = Rig(driver, camera, make_policy("default-32"), clock)
    monkeypatch.setattr(figure5, "build_rig", lambda robot, options: rig)
    params = {"learner": "published-4", "robot": "any", "options": {}, "cycles": 20}
    timing = figure5.run_cycles(params)["timing"]
    moved = [action for _, action in driver.changes]
    assert moved.count(Action.STOP) < len(moved) and moved[-1] is Action.STOP
    assert timing["nodes"] == 4
    for name in ("applying_hz", "learning_hz"):
        assert timing[name] == pytest.approx(20, rel=0.05), "the loop runs at the camera's rate"


def test_every_habit_is_tried_in_every_place_at_every_rate():
    tasks = list(GATE.plan(ExperimentSettings()))
    long = [task.params for task in tasks if task.params["teach_s"] == LONG_S]
    met = {(own["habit"], own["world"], own["rate_hz"]) for own in long}
    assert met == {(h, w, r) for h in HABITS for w in WORLDS for r in RATES_HZ}
    assert {*WORLDS} <= {*world_names()} and len(HABITS) >= 12
    assert 0 < sum(task.params["correct_s"] > 0 for task in tasks) < len(tasks)
    for settings, fewest in ((ExperimentSettings(), 240), (ExperimentSettings(seeds=20), 480)):
        seeds = [task.params["seed"] for task in GATE.plan(settings)]
        assert len({*seeds}) == len(seeds) >= fewest, "each robot has a seed of its own"
    ready = list(READY.plan(ExperimentSettings()))
    assert len(ready) == PILOTS
    for name in ("habit", "world", "rate_hz"):
        counts = Counter(task.params[name] for task in ready)
        assert max(counts.values()) - min(counts.values()) <= 2, "all pilots occur equally often"


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
    """Return the gate's rows if one robot and its pilot drove with these figures, and all others
    well.

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
    robot = {"world": "fork", "rate_hz": 10.0, "seed": 3, "learner": "default-32"}
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
