"""Whole lessons of experiments: the project's teachers and learners, and ideas from files."""

from pathlib import Path
from unittest import mock

import pytest

from robot.devices.rig import Rig
from robot.errors import ConfigurationError
from robot.lab import figure5, proportional
from robot.lab.experiment import ExperimentSettings
from robot.lab.figure3 import FIGURE3
from robot.lab.ideas import make_learner, make_teacher, make_trial
from robot.lab.lessons import run_lesson
from robot.lab.simulated_pilots.teachers import SonarController
from robot.lab.task import Task
from robot.lab.trial import FRAME_RATE_HZ
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import DEFAULT_MOVES, Action, DrivenBy, Mode
from tests.robot.footage import write_footage

BOX = {"world": "box", "moves": ("forward", "left"), "teacher": "usual", "seed": 1}
HOW_TO = Path(__file__).parents[3] / "docs" / "howto" / "try-an-idea.md"


def examples() -> list[str]:
    """The Python blocks of the how-to, which a reader will copy."""
    parts = HOW_TO.read_text("utf-8").split("```python\n")[1:]
    return [part.split("```")[0] for part in parts]


def test_the_pilot_teaches_and_then_the_robot_drives_and_learns_nothing_unsupervised():
    """That the same seed gives the same numbers is tested in `test_runner`."""
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
    """In virtual time only this takes time: the camera takes a picture every 50 ms."""
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
        assert timing[name] == pytest.approx(20, rel=0.05), "the camera sets the pace"
