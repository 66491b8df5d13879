"""Tables, reports, and the plans and figures of every experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot.errors import MissingExtraError, RecordingError
from robot.lab.chance import deviation
from robot.lab.experiment import EXPERIMENTS, ExperimentSettings, load_experiment
from robot.lab.report import write_html
from robot.lab.task import Task
from robot.lab.variants import VARIANTS
from robot.study.table import Table
from server.__main__ import main

QUICK = ExperimentSettings(quick=True)
FIGURES = """
ssd ssd_alike ssd_frequent ssd_in_place ssd_against_lesson ssd_of_lesson ssd_of_moves_made
asking_share longest_push_s pushing_s_per_min collisions_per_min steering_per_s
covered_m2 driven_m driven_m_per_min seconds right_m brought_to_wall
blocked right left turning turning_right turns
accuracy balanced_accuracy calibration_error agreement correct frames examples
taught_s tried_s
"""
DRIVE = dict.fromkeys(FIGURES.split(), 1.0) | {"never": ["left"], "stuck": False, "in_view": None}


def made_up(task: Task) -> dict[str, Any]:
    """A result with every figure: plans and tables are tested without the runs between them."""
    stage = {"examples": 100, "takeovers": 7, "decisions": 300, "scores": [0.0, 1.0]}
    drive = DRIVE | {"teacher": DRIVE}
    return {
        **drive,
        **dict.fromkeys(("before", "after", "alone", "first", "second", "taught"), drive),
        "is_ready": True,
        "missing": [],
        "stages": [stage] * len(task.params.get("counts", ())),
        "timing": {"learning_hz": 100.0, "applying_hz": 200.0},
    }


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_makes_tables_and_a_report(name: str) -> None:
    try:
        experiment = load_experiment(name)
    except MissingExtraError as error:
        pytest.skip(f"NOT TESTED: {error}")
    tasks = list(experiment.plan(QUICK))
    assert len({task.key() for task in tasks}) == len(tasks), "no run twice"
    runs = [(task, made_up(task)) for task in tasks]
    tables = experiment.tables(runs)
    assert tables and all(table.rows for table in tables)
    html = write_html([(experiment, runs)], "drivelesson experiment <x>")
    assert "experiment &lt;x&gt;" in html
    for loads in ("<script", "<link", "<img", "src=", 'href="http', "url(http"):
        assert loads not in html, "the report needs nothing from elsewhere"
    assert experiment.title in html


def test_the_ablation_shows_every_ground_in_one_table(tmp_path: Path) -> None:
    for name in ("hall_A.npz", "hall_B.npz"):
        (tmp_path / name).touch()
    settings = ExperimentSettings(quick=True, worlds=("TMaze",), recordings=str(tmp_path))
    tasks = list(load_experiment("ablation").plan(settings))
    table, *_ = load_experiment("ablation").tables([(task, made_up(task)) for task in tasks])
    assert [row[0] for row in table.rows] == ["default", *VARIANTS, "published"]
    grounds = ("trial 2: SSD", "TMaze", "footage: accuracy")
    assert set(grounds) < set(table.columns)
    assert all(None not in row for row in table.rows), "each is tried everywhere"
    assert table.note == "Not run: Sidewalk, CarRacing, ViZDoom."


@pytest.mark.parametrize("name", ["figure3", "ablation"])
def test_a_folder_without_recordings_is_told_and_not_passed_over(name: str, tmp_path: Path) -> None:
    settings = ExperimentSettings(quick=True, recordings=str(tmp_path))
    with pytest.raises(RecordingError, match=r"has no recordings named PLACE_A\.npz"):
        list(load_experiment(name).plan(settings))


def test_more_seeds_are_more_runs() -> None:
    few, many = (
        len(list(load_experiment("figure7").plan(ExperimentSettings(seeds=n)))) for n in (1, 3)
    )
    assert many == 3 * few


@pytest.mark.parametrize("name", ["figure5", "figure6"])
def test_a_learner_that_is_named_runs_once_with_its_own_number_of_nodes(name: str) -> None:
    settings = ExperimentSettings(quick=True, learners=("default-8", "knn-9"))
    experiment = load_experiment(name)
    tasks = list(experiment.plan(settings))
    assert [task.params["learner"] for task in tasks] == ["default-8", "knn-9"]
    (table,) = experiment.tables([(task, made_up(task)) for task in tasks])
    assert [row[0] for row in table.rows[-2:]] == ["default-8", "knn-9"]


@pytest.mark.parametrize("name", ["figure3", "figure6", "figure7", "figure8"])
def test_a_teacher_that_is_named_teaches_wherever_people_do(name: str) -> None:
    tasks = list(load_experiment(name).plan(ExperimentSettings(quick=True, teacher="wide")))
    taught = [task.params["teacher"] for task in tasks if task.params.get("who") != "robot"]
    assert taught and set(taught) == {"wide"}


def test_columns_without_a_figure_are_left_out_of_a_plot() -> None:
    settings = ExperimentSettings(quick=True, learners=("default-8", "default-16"))
    experiment = load_experiment("figure3")
    runs = [(task, made_up(task)) for task in experiment.plan(settings)]
    assert "paper mean" in write_html([(experiment, runs)], "drivelesson experiment")


def test_a_table_is_printed_as_text() -> None:
    table = Table(title="T", columns=("who", "x"), rows=(("a", 1.0), ("bb", None)), note="N")
    assert table.as_text().splitlines() == [
        "T",
        "---------",
        "who     x",
        "---------",
        "a    1.00",
        "bb      -",
        "N",
    ]


def test_the_standard_deviation_equals_that_computed_by_hand() -> None:
    assert deviation([1.0, 2.0, 6.0]) == pytest.approx(7**0.5)
    assert deviation([4.0]) == 0.0


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--learner", "nobody-3"], "nobody"),
        (["--teacher", "nobody"], "unknown teacher 'nobody'"),
        (["--recordings", "/nowhere/at/all"], "no folder"),
    ],
)
def test_a_wrong_call_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    status = main(["experiment", "figure7", "--folder", str(tmp_path), *words])
    assert status == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1


def test_the_command_line_refuses_an_empty_list_of_seeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as refusal:
        main(["experiment", "figure7", "--folder", str(tmp_path), "--seeds", "0"])
    assert refusal.value.code == 2
    assert "--seeds: must be a whole number of at least 1" in capsys.readouterr().err
