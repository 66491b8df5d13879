"""`drivelesson experiment`, `learn` and `bench`, as a user types them; no time is judged."""

import json
import os
import threading
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from robot.errors import ConfigurationError
from robot.lab.experiment import Experiment, seeded
from robot.policy import autosize
from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from server.__main__ import main
from server.lab.bench import link, subject
from server.lab.bench.report import TOO_BUSY, in_turns, percentiles
from server.lab.bench.subject import ServerUnderTest
from tests.kit.sizes import only_full
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
    assert "60 examples" in told and SAME in told, "a recording that is named twice is learned once"
    say("episodes trim last --from 0.5 --to 2.5")
    assert "it was edited" in say("learn last --check", status=2)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("nobody", "no episode matches"),
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


@pytest.mark.realtime
def test_bench_link_measures_viewers_and_commands(tmp_path, monkeypatch):
    monkeypatch.setattr(link, "_SETTLE_S", 0.05)  # figures without a limit need no pause
    monkeypatch.setattr(link, "_COMMANDS", 8)
    monkeypatch.setattr(link, "_COMMAND_EVERY_S", 0.1)
    file = tmp_path / "link.json"
    # Even a busy machine sends some pictures in this time.
    words = ["bench", "link", "--viewers", "1", "--seconds", "2", "--turns", "1"]
    assert main([*words, "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    [ours] = result["viewers"]
    assert ours["frames_per_second"] > 0 and ours["loop_hz"] > 0
    for figures in (ours["latency_ms"], result["commands"]["wire_to_drive_ms"]):
        assert 0 < figures["p50"] <= figures["p95"]
    assert 0 <= ours["serving_cpu_share_idle_after"] < 1
    assert ours["beside_plain"]["own"] > 0 and ours["beside_plain"]["peer"] > 0


@only_full
@pytest.mark.realtime
def test_bench_crowd_compares_commands_with_and_without_a_crowd(capsys):
    words = ["bench", "crowd", "--greedy", "2", "--viewers", "3", "--seconds", "0.5", "--json"]
    assert main(words) == 0
    result = json.loads(capsys.readouterr().out)
    for side in ("without", "with"):
        assert 0 < result["greedy"][side]["p50"] <= result["greedy"][side]["p99"]
    assert result["greedy"]["ratio"] > 0 and result["watched"]["slowest_hz"] > 0


def test_unmeasured_figures_are_reported_as_missing():
    names = "viewers frames_per_second process_cpu_us_per_frame loop_hz late_cycles"
    none = percentiles([])
    row = dict.fromkeys(names.split(), 0.0) | {"cpu_us_per_frame": None, "latency_ms": none}
    text = link._table({"viewers": [row], "commands": {"wire_to_drive_ms": none}}).as_text()
    assert TOO_BUSY in text and "nan" not in text and "None" not in text


def test_the_ratio_is_that_of_a_turn_in_the_middle_unless_they_differ_too_much():
    found = in_turns([2.0, 30.0, 4.0], [4.0, 50.0, 10.0])
    assert (found["ratio"], found["spread"]) == (0.5, 0.2)
    assert (found["own"], found["peer"], found["turns"]) == (4.0, 10.0, 3)
    assert in_turns([1.0, 1.0, 2.1], [1.0, 1.0, 1.0])["ratio"] is None
    assert in_turns([1.0, 1.0, 1.9], [1.0, 1.0, 1.0])["ratio"] == 1.0


def serve_for_ever(line: Connection, kind: str, rate_hz: float) -> None:
    """Run on although the pipe is closed."""
    line.send(8080)
    threading.Event().wait()


def test_a_server_that_does_not_end_is_killed_and_this_is_reported(monkeypatch):
    monkeypatch.setattr(subject, "_serve", serve_for_ever)
    served = ServerUnderTest("drivelesson", 30.0)
    with pytest.raises(ConfigurationError, match="had not ended after 60 s"), served:
        monkeypatch.setattr(served._process, "join", lambda patience_s: None)
    monkeypatch.undo()
    served._process.join()
    assert served._process.exitcode, "the process was killed"


def test_bench_learner_writes_figures_for_every_size(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(autosize, "SIZES", (2, 8))
    out = tmp_path / "bench.json"
    assert main(["bench", "learner", "--json", str(out)]) == 0
    result = json.loads(out.read_text())
    assert [row["max_nodes"] for row in result["policies"]] == [2, 8]
    assert all(row["learn_p99_us"] >= row["learn_us"] > 0 for row in result["policies"])
    for row in result["cluster"]["sizes"]:
        assert row["train_per_product"] == pytest.approx(row["train_us"] / row["product_us"])
    assert "frames/s" in capsys.readouterr().out
