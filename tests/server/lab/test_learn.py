"""`drivelesson learn`, as a user types it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from server.__main__ import main
from tests.robot.recordings.drives import RecordedBench
from tests.server.conftest import Say


def test_learning_again_gives_the_nodes_of_driving_and_saves_them(
    episode_id: str, data: Path, tmp_path: Path, say: Say
) -> None:
    told = say("learn last --check --out again")
    assert "the nodes are the same as those learned by driving" in told
    model = ModelStore(Storage(data)).load("again")
    assert (model.summary.learner, model.summary.n_examples) == ("default-8", 60)
    say(f"learn {episode_id} --learner published --max-nodes 64 --out {tmp_path}/m.npz")
    assert (tmp_path / "m.npz").stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "complaint"),
    [("learn last --learner oracle", "oracle"), ("learn nobody", "no episode of this name")],
)
def test_recordings_that_cannot_be_learned_are_reported_in_one_clear_line(
    episode_id: str, words: str, complaint: str, say: Say
) -> None:
    told = say(words, status=2)
    assert complaint in told.splitlines()[-1]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--out a/b", "'a/b' is not a valid name"),
        ("--out FILE/m.npz", "cannot write"),
        (f"--out {'n' * 300}.npz", "cannot write"),
        ("--out LINK.npz", "exists already"),
        ("--out THERE.npz", "THERE.npz exists already"),
        ("--check --learner published", "cannot be used with --check"),
    ],
)
def test_an_impossible_output_is_reported_before_anything_is_learned(
    episode_id: str,
    tmp_path: Path,
    words: str,
    complaint: str,
    monkeypatch: pytest.MonkeyPatch,
    say: Say,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("server.lab.learn.learn_again", lambda *_, **__: pytest.fail("it learned"))
    for name in ("FILE", "THERE.npz"):
        Path(name).touch()
    if os.name == "nt":
        Path("LINK.npz").touch()
    else:
        Path("LINK.npz").symlink_to("nowhere")
    there = sorted(tmp_path.iterdir())
    assert complaint in say(f"learn last {words}", status=2)
    assert sorted(tmp_path.iterdir()) == there


def test_an_edited_recording_is_no_longer_what_was_driven(episode_id: str, say: Say) -> None:
    say("episodes trim last --from 0.5 --to 2.5")
    assert "it was edited" in say("learn last --check", status=2)


def test_a_failed_check_suggests_continue_and_saves_nothing(
    data: Path, say: Say, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_a_recording_that_is_named_twice_is_learned_once(
    episode_id: str, data: Path, say: Say
) -> None:
    file = EpisodeStore(Storage(data)).path(episode_id)
    told = say(f"learn last {episode_id} {file} --check")
    assert "60 examples" in told and "the nodes are the same as those learned by driving" in told
