"""Wrong calls of the lab's commands get an error that shows the right form."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robot.lab.experiment import Experiment, seeded
from robot.lab.task import Params, Result
from server.cli.main import main

WRONG = [
    (["bench", "lnk"], "(did you mean 'link'?)"),
    (["experiment", "figure3", "--seeds", "0"], "--seeds: must be a whole number of at least 1"),
]


@pytest.mark.parametrize(("words", "sentence"), WRONG)
def test_the_error_for_a_wrong_call_shows_the_right_call(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize("name", ["habits", "ready", "degrees"])
def test_two_learners_for_one_are_refused_before_anything_runs(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    two = ["--learner", "default-16", "--learner", "published-16"]
    words = ["experiment", "figure7", name, "--quick", "--folder", str(tmp_path / "runs")]
    assert main([*words, *two]) == 2
    assert "take only one --learner, not default-16, published-16" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


def run_named(params: Params) -> Result:
    return {"seed": params["seed"]}


def test_an_experiment_that_is_named_twice_is_run_and_counted_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    experiment = Experiment(
        title="named",
        text="",
        plan=lambda settings: seeded(
            run_named,
            ({"learner": name, "world": w} for name in settings.learners for w in settings.worlds),
            settings,
        ),
        tables=lambda runs: [],
    )
    monkeypatch.setattr("server.lab.experiment.load_experiment", lambda name: experiment)
    words = ["experiment", "ground", "--seeds", "2", "--jobs", "1", "--folder", str(tmp_path)]
    twice = ["--learner", "default-8", "--world", "Sidewalk"] * 2
    out = tmp_path / "out.json"
    assert main([*words, *twice, "--learner", "knn-3", "--json", str(out)]) == 0
    params = [run["params"] for run in json.loads(out.read_text())["ground"]]
    assert [(own["learner"], own["seed"]) for own in params] == [
        *(("default-8", 0), ("default-8", 1)),
        *(("knn-3", 0), ("knn-3", 1)),
    ]
