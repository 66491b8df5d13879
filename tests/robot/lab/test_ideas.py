"""Ideas from files outside the project, and the errors of broken ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.lab.experiment import ExperimentSettings
from robot.lab.figure3 import FIGURE3
from robot.lab.ideas import make_learner, make_teacher
from robot.lab.lessons import run_lesson
from robot.lab.simulated_pilots.teachers import SonarController
from robot.types import DEFAULT_MOVES
from tests.robot.footage import write_footage

DOCS = Path(__file__).parents[3] / "docs" / "howto" / "try-an-idea.md"


def blocks(language: str) -> list[str]:
    """The code blocks of the how-to, which a reader will copy."""
    parts = DOCS.read_text("utf-8").split(f"```{language}\n")[1:]
    return [part.split("```")[0] for part in parts]


def test_the_projects_own_learners_and_teachers_are_found_by_name() -> None:
    assert make_learner("published-8", DEFAULT_MOVES).name == "published-8"
    assert isinstance(make_teacher("sonar", DEFAULT_MOVES), SonarController)
    for name in ("usual", "early", "late", "wide", "habit"):
        make_teacher(name, DEFAULT_MOVES)


def test_the_ideas_of_the_how_to_enter_an_experiment(tmp_path: Path) -> None:
    learner, teacher = blocks("python")
    assert sum(bool(line.strip()) for line in learner.splitlines()) <= 20
    (tmp_path / "idea.py").write_text(learner)
    (tmp_path / "timid.py").write_text(teacher)
    result = run_lesson(
        {
            "world": "box",
            "moves": ("forward", "left"),
            "learner": f"{tmp_path}/idea.py:LastFrames",
            "teacher": f"{tmp_path}/timid.py:Timid",
            "teach_s": 20.0,
            "alone_s": 5.0,
            "reference_s": 5.0,
            "seed": 0,
        }
    )
    assert result["taught"]["agreement"] > 0.5
    assert 0.0 < result["before"]["ssd"] < 100.0


def test_an_idea_is_tried_on_recorded_footage_too(tmp_path: Path) -> None:
    pytest.importorskip("cv2", reason="NOT TESTED: OpenCV is not installed")
    (tmp_path / "idea.py").write_text(blocks("python")[0])
    for seed, name in enumerate(("hall_A.npz", "hall_B.npz")):
        write_footage(tmp_path / name, seed=seed)
    idea = f"{tmp_path}/idea.py:LastFrames"
    settings = ExperimentSettings(quick=True, learners=(idea,), recordings=str(tmp_path))
    tasks = [task for task in FIGURE3.plan(settings) if task.kind == "recorded_footage"]
    assert [task.params["learner"] for task in tasks] == [idea, idea]
    assert 0.5 < tasks[0].run(tasks[0].params)["accuracy"] <= 1.0


@pytest.mark.parametrize(
    ("text", "name", "complaint"),
    [
        ("", "Missing", "no attribute 'Missing'"),
        ("1 / 0", "Name", "ZeroDivisionError"),
        ("class Name: pass", "Name", "neither a Policy nor a Learner"),
    ],
)
def test_a_broken_idea_is_one_clear_error(
    tmp_path: Path, text: str, name: str, complaint: str
) -> None:
    file = tmp_path / "idea.py"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=complaint) as caught:
        make_learner(f"{file}:{name}", DEFAULT_MOVES)
    assert str(file) in str(caught.value)


def test_the_error_for_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(ConfigurationError, match=r"sonar, .*usual"):
        make_teacher("nobody", DEFAULT_MOVES)
    with pytest.raises(ConfigurationError, match=r"no file .*gone\.py"):
        make_teacher("gone.py:Name", DEFAULT_MOVES)
    with pytest.raises(ConfigurationError, match="published"):
        make_learner("nobody-7", DEFAULT_MOVES)
