"""The information about a recording is true: lists, exports, films and `last`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from robot.coaching.gallery import images
from robot.errors import ConfigurationError
from robot.exchange.film import check_suffix, write_look
from robot.exchange.timeline import make_timeline
from robot.exchange.tub import write_tub
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.summary import read_summary
from robot.store.folder import Storage
from robot.types import Action, Mode
from server.__main__ import main
from tests.kit.sizes import seeds
from tests.robot.exchange.imported import import_pictures

from .drives import RecordedBench, record_drive


def imported(folder: Path, name: str, started_at_s: float) -> None:
    black, labels = np.zeros((3, 120, 160, 3), np.uint8), [Action.LEFT] * 3
    import_pictures(folder / f"{name}.mcap", black, labels, started_at_s=started_at_s)


@pytest.mark.parametrize("theirs_first", [True, False])
def test_the_word_last_means_the_newest_by_time_not_by_name(
    tmp_path: Path,
    theirs_first: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("DRIVELESSON_DATA", str(tmp_path))
    storage = Storage(tmp_path)
    own = record_drive(storage.folder("episodes"), frames=20)
    shift_s = -86_400 if theirs_first else 86_400
    imported(storage.folder("episodes"), "theirs", own.started_at_s + shift_s)
    newest = own.id if theirs_first else "theirs"
    assert main(["episodes", "show", "last"]) == 0
    assert newest in capsys.readouterr().out
    assert main(["episodes", "export", "last", "--as", "folder"]) == 0
    assert f"{newest}-folder" in capsys.readouterr().out
    assert main(["episodes", "delete", "last"]) == 0
    assert newest in capsys.readouterr().out


def test_the_list_leaves_out_what_was_undone(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.drive(range(40))
    robot.loop.submit(lambda: robot.loop.history.undo(0.5))
    robot.tick()
    robot.drive(range(40, 50))
    lessons = robot.loop.history.n_examples
    [path] = robot.finish()
    assert lessons < 50
    listed = sum(read_summary(path).taught.values())
    assert listed == lessons == len(taught_frames(open_episode(path)))
    assert write_tub(open_episode(path), Notes(), tmp_path / "tub") == lessons


def test_dates_are_those_of_the_drive_not_of_the_clocks_start(tmp_path: Path) -> None:
    """The loop's clock showed 0 when the machine was switched on, days before the drive."""
    robot = RecordedBench(tmp_path)
    robot.clock.advance(3 * 86_400.0)
    robot.clock.set_wall(1_700_000_000)
    robot.tick()
    robot.drive(range(20))
    [path] = robot.finish()
    episode = open_episode(path)
    assert episode.origin_ns / 1e9 < 1_700_000_000 - 2 * 86_400
    write_tub(episode, Notes(), tmp_path / "tub")
    manifest = (tmp_path / "tub" / "manifest.json").read_text().splitlines()
    assert json.loads(manifest[3])["created_at"] == pytest.approx(1_700_000_000, abs=60)
    with path.open("rb") as file:
        attached = list(make_reader(file).iter_attachments())
    assert len(attached) == 3, "the models and the index"
    for attachment in attached:
        assert attachment.create_time / 1e9 == pytest.approx(1_700_000_000, abs=60)


@pytest.mark.parametrize("seed", seeds(5, 20))
def test_a_film_takes_as_long_as_the_drive(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times_s = np.cumsum(rng.uniform(0.02, 0.09, 400)) + rng.uniform(0, 100)
    times_s[200:] += rng.uniform(0, 0.9)  # the camera paused for a moment
    rate = int(rng.integers(5, 61))
    (shown,) = make_timeline(times_s.tolist()).evenly(rate)
    assert len(shown) / rate == pytest.approx(times_s[-1] - times_s[0], abs=0.1 + 1.5 / rate)
    due_s = times_s[0] + np.arange(len(shown)) / rate
    nearest_s = np.abs(times_s[:, None] - due_s).min(axis=0)
    assert np.abs(times_s[shown] - due_s) == pytest.approx(nearest_s, abs=1e-6)


def test_the_film_itself_takes_as_long_as_the_drive(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    pytest.importorskip("cv2")
    robot = RecordedBench(tmp_path)
    robot.start(Mode.TRAIN, 0)
    for scene in range(60):  # pictures come at irregular times, one in ten late
        robot.step(scene, Action.FORWARD, seconds=0.19 if scene % 10 == 9 else 0.04)
    robot.stop()
    [path] = robot.finish()
    episode = open_episode(path)
    write_look(episode, Notes(), tmp_path / "x.mp4")
    with av.open(str(tmp_path / "x.mp4")) as film:
        length_s = film.duration / av.time_base
    entries = list(episode.frames.values())
    drive_s = entries[-1].captured_s - entries[0].captured_s
    assert length_s == pytest.approx(drive_s, abs=0.1)


@pytest.mark.parametrize("name", ["film.txt", "film", "film.mcap", "film.mp4.bak"])
def test_a_name_that_is_no_films_gets_a_sentence(
    tmp_path: Path,
    name: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("DRIVELESSON_DATA", str(tmp_path / "data"))
    record_drive(Storage(tmp_path / "data").folder("episodes"), frames=10)
    out = tmp_path / name
    assert main(["episodes", "export", "last", "--as", "film", "--out", str(out)]) == 2
    assert ".mp4" in capsys.readouterr().err.splitlines()[-1]
    assert not out.exists()
    with pytest.raises(ConfigurationError, match=r"\.mp4"):
        check_suffix(out)


def test_names_of_exports_have_no_spaces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DRIVELESSON_DATA", str(tmp_path))
    storage = Storage(tmp_path)
    imported(storage.folder("episodes"), "our long hall", 1e9)
    for _ in range(2):
        assert main(["episodes", "export", "last", "--as", "tub"]) == 0
    capsys.readouterr()
    names = sorted(path.name for path in storage.exports.iterdir())
    assert names == ["our-long-hall-tub", "our-long-hall-tub-2"]


@pytest.mark.parametrize("does", ["nothing", "drives", "teaches", "edits"])
def test_runs_in_which_nothing_was_taught_or_driven_are_not_kept(tmp_path: Path, does: str) -> None:
    robot = RecordedBench(tmp_path)
    if does == "edits":
        robot.drive(range(5))
        robot.recorder.finish()
        node = images(robot.loop.history.policy)[0].node_id
        robot.loop.submit(lambda: robot.loop.history.edit("pin", node, True))
        robot.tick()
        assert len(robot.finish()) == 2
        return
    robot.start(Mode.TRAIN, 0)
    for scene in range(5):
        held = Action.LEFT if does == "teaches" else None
        robot.step(scene, held)
    if does == "drives":
        robot.drive(range(5, 10), Mode.AUTONOMOUS)
    robot.stop()
    assert len(robot.finish()) == (does != "nothing")
