"""`drivelesson experiment` and `drivelesson learn`, as a user types them."""

import json
import os
from pathlib import Path

import pytest

from robot.lab.experiment import Experiment, seeded
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from server.__main__ import main
from tests.robot.recordings.drives import RecordedBench


@pytest.mark.parametrize("name", ["habits", "ready", "degrees"])
def test_two_learners_for_one_are_refused_before_anything_runs(name, say, tmp_path):
    words = f"experiment figure7 {name} --quick --folder {tmp_path}/runs"
    told = say(f"{words} --learner default-16 --learner published-16", status=2)
    assert "take only one --learner, not default-16, published-16" in told
    assert not (tmp_path / "runs").exists()


def run_named(params):
    return {"seed": params["seed"]}


def test_an_experiment_that_is_named_twice_is_run_and_counted_once(monkeypatch, say, tmp_path):
    def plan(settings):
        cases = (
            {"learner": name, "world": w} for name in settings.learners for w in settings.worlds
        )
        return seeded(run_named, cases, settings)

    experiment = Experiment(title="named", text="", plan=plan, tables=lambda runs: [])
    monkeypatch.setattr("server.lab.experiment.load_experiment", lambda name: experiment)
    twice = "--learner default-8 --world Sidewalk " * 2
    words = f"experiment ground --seeds 2 --jobs 1 --folder {tmp_path} {twice}"
    say(f"{words} --learner knn-3 --json {tmp_path}/out.json")
    runs = json.loads((tmp_path / "out.json").read_text())["ground"]
    each = [(run["params"]["learner"], run["params"]["seed"]) for run in runs]
    assert each == [("default-8", 0), ("default-8", 1), ("knn-3", 0), ("knn-3", 1)]


SAME = "the nodes are the same as those learned by driving"


def test_learning_again_gives_the_nodes_of_driving_and_saves_them(episode_id, data, tmp_path, say):
    assert SAME in say("learn last --check --out again")
    model = ModelStore(Storage(data)).load("again")
    assert (model.summary.learner, model.summary.n_examples) == ("default-8", 60)
    say(f"learn {episode_id} --learner published --max-nodes 64 --out {tmp_path}/m.npz")
    assert (tmp_path / "m.npz").stat().st_size > 1000
    file = EpisodeStore(Storage(data)).path(episode_id)
    told = say(f"learn last {episode_id} {file} --check")
    assert "60 examples" in told and SAME in told, "named twice, it is learned once"
    say("episodes trim last --from 0.5 --to 2.5")
    assert "it was edited" in say("learn last --check", status=2)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("nobody", "no episode of this name"),
        ("last --learner oracle", "oracle"),
        ("last --out a/b", "'a/b' is not a valid name"),
        ("last --out FILE/m.npz", "cannot write"),
        (f"last --out {'n' * 300}.npz", "cannot write"),
        ("last --out LINK.npz", "exists already"),
        ("last --out FILE.npz", "FILE.npz exists already"),
        ("last --check --learner published", "cannot be used with --check"),
    ],
    ids=lambda text: text[:30],
)
def test_what_cannot_be_learned_or_saved_is_reported_before_anything_is_learned(
    episode_id, tmp_path, words, complaint, monkeypatch, say
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("server.lab.learn.learn_again", lambda *_, **__: pytest.fail("it learned"))
    for name in ("FILE", "FILE.npz"):
        Path(name).touch()
    if os.name == "nt":
        Path("LINK.npz").touch()
    else:
        Path("LINK.npz").symlink_to("nowhere")
    there = sorted(tmp_path.iterdir())
    assert complaint in say(f"learn {words}", status=2).splitlines()[-1]
    assert sorted(tmp_path.iterdir()) == there


def test_a_failed_check_suggests_continue_and_saves_nothing(data, say, capsys):
    storage = Storage(data)
    robot = RecordedBench(storage.folder("episodes"))
    robot.drive(range(30))
    robot.recorder.finish()
    robot.drive(range(30, 60))
    second = robot.finish()[-1].stem
    assert main(["learn", second, "--check", "--out", "x"]) == 1
    told = capsys.readouterr().out
    assert "--continue" in told and "x was not saved" in told
    assert not list(storage.models.iterdir())
    say(f"learn {second} --check --continue --out x")
    assert [path.name for path in storage.models.iterdir()] == ["x"]
