"""Tables and reports show the plans and figures of every experiment."""

from typing import Any

import pytest

from robot.errors import MissingExtraError, RecordingError
from robot.lab.chance import deviation, interval
from robot.lab.experiment import EXPERIMENTS, ExperimentSettings, load_experiment
from robot.lab.report import write_html
from robot.lab.task import Task
from robot.lab.variants import VARIANTS
from server.__main__ import main
from server.lab.experiment import USED_BY

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
    """Return a result with every figure, so that plans and tables are tested without real runs."""
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


def planned(name: str, **settings: Any) -> list[Task]:
    return list(load_experiment(name).plan(ExperimentSettings(quick=True, **settings)))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_makes_tables(name):
    try:
        experiment = load_experiment(name)
    except MissingExtraError as error:
        pytest.skip(f"NOT TESTED: {error}")
    tasks = planned(name)
    assert len({task.key() for task in tasks}) == len(tasks), "no run is planned twice"
    runs = [(task, made_up(task)) for task in tasks]
    tables = experiment.tables(runs)
    assert tables and all(table.rows for table in tables)
    for table in tables:
        assert set(experiment.drawn) <= set(table.columns)
    assert all(plot.series for plot in experiment.plots(runs))


@pytest.mark.parametrize("name", ["figure5", "ground"], ids=["points", "lines"])
def test_a_report_has_plots_and_tables_and_needs_nothing_from_elsewhere(name):
    experiment = load_experiment(name)
    runs = [(task, made_up(task)) for task in planned(name)]
    html = write_html([(experiment, runs)], "drivelesson experiment <x>")
    assert "experiment &lt;x&gt;" in html
    for loads in ("<script", "<link", "<img", "src=", 'href="http', "url(http"):
        assert loads not in html
    assert experiment.title in html and "<svg" in html


def test_the_ablation_shows_every_ground_in_one_table(tmp_path):
    for name in ("hall_A.npz", "hall_B.npz"):
        (tmp_path / name).touch()
    tasks = planned("ablation", worlds=("TMaze",), recordings=str(tmp_path))
    table, *_ = load_experiment("ablation").tables([(task, made_up(task)) for task in tasks])
    assert [row[0] for row in table.rows] == ["default", *VARIANTS, "published"]
    assert {"trial 2: SSD", "TMaze", "footage: accuracy"} < set(table.columns)
    assert all(None not in row for row in table.rows), "each variant has a figure in each column"
    assert table.note == "Not run: Sidewalk, CarRacing, ViZDoom."


@pytest.mark.parametrize("name", ["figure3", "ablation"])
def test_a_folder_without_recordings_is_reported_and_not_ignored(name, tmp_path):
    with pytest.raises(RecordingError, match=r"has no recordings named PLACE_A\.npz"):
        planned(name, recordings=str(tmp_path))


def test_a_learner_that_is_named_runs_once_with_its_own_number_of_nodes():
    named = ["default-8", "knn-9"]
    for name in ("figure5", "figure6"):
        tasks = planned(name, learners=tuple(named))
        assert [task.params["learner"] for task in tasks] == named, name
        (table,) = load_experiment(name).tables([(task, made_up(task)) for task in tasks])
        assert [row[0] for row in table.rows[-2:]] == named, name


@pytest.mark.parametrize("name", ["figure3", "figure6", "figure7", "figure8"])
def test_a_teacher_that_is_named_teaches_wherever_people_do(name):
    own = [task.params for task in planned(name, teacher="wide")]
    taught = [params["teacher"] for params in own if params.get("who") != "robot"]
    assert taught and set(taught) == {"wide"}


class Watched(ExperimentSettings):
    """Settings that note the names that were read."""

    def __getattribute__(self, name: str) -> Any:
        SEEN.add(name)
        return super().__getattribute__(name)


SEEN: set[str] = set()


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_each_experiment_uses_the_options_that_are_not_refused(name):
    try:
        experiment = load_experiment(name)
    except MissingExtraError as error:
        pytest.skip(f"NOT TESTED: {error}")
    SEEN.clear()
    list(experiment.plan(Watched(quick=True)))
    assert SEEN & USED_BY.keys() == {of for of, (_, users) in USED_BY.items() if name in users}


def test_deviation_and_confidence_interval_equal_those_computed_by_hand():
    assert deviation([1.0, 2.0, 6.0]) == pytest.approx(7**0.5)
    assert deviation([4.0]) == 0.0
    low, high = interval([0.0, 1.0] * 50)
    assert 0.35 < low < 0.45 < 0.55 < high < 0.65
    assert interval([2.0, 2.0]) == (2.0, 2.0)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--learner", "nobody-3"], "nobody"),
        (["--teacher", "nobody"], "unknown teacher 'nobody'"),
        (["--recordings", "/nowhere/at/all"], "no folder"),
        (["--world", "Sidewalk"], "figure7 does not use --world; leave it out (used by ablation"),
        (["--json", "/nowhere/at/all.json"], "cannot write /nowhere/at/all.json"),
        (["--report", "/nowhere/at/all.html"], "cannot write /nowhere/at/all.html"),
    ],
)
def test_a_wrong_call_is_reported_in_one_line(tmp_path, capsys, words, complaint):
    assert main(["experiment", "figure7", "--folder", str(tmp_path), *words]) == 2
    error = capsys.readouterr().err
    assert complaint in error and error.count("\n") == 1
