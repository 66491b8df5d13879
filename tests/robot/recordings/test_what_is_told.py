"""The information about a recording is true: lists, exports, films and `last`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from robot.errors import ConfigurationError
from robot.exchange.film import check_suffix, write_look
from robot.exchange.tub import write_tub
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from robot.store.folder import Storage
from robot.types import Action, Mode
from server.__main__ import main
from tests.robot.exchange.imported import import_pictures

from .drives import RecordedBench, record_drive


def imported(folder: Path, name: str, started_at_s: float) -> None:
    black, labels = np.zeros((3, 120, 160, 3), np.uint8), [Action.LEFT] * 3
    import_pictures(folder / f"{name}.mcap", black, labels, started_at_s=started_at_s)


@pytest.fixture
def storage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Storage:
    """The data folder of the commands."""
    monkeypatch.setenv("DRIVELESSON_DATA", str(tmp_path))
    return Storage(tmp_path)


@pytest.mark.parametrize("theirs_first", [True, False])
def test_the_word_last_means_the_newest_by_time_not_by_name(
    storage: Storage, theirs_first: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    own = record_drive(storage.folder("episodes"), frames=20)
    shift_s = -86_400 if theirs_first else 86_400
    imported(storage.folder("episodes"), "theirs", own.started_at_s + shift_s)
    newest = own.id if theirs_first else "theirs"
    for command in (["show"], ["export", "--as", "folder"], ["delete"]):
        assert main(["episodes", command[0], "last", *command[1:]]) == 0
        assert newest in capsys.readouterr().out


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


def test_a_film_takes_as_long_as_the_drive(tmp_path: Path) -> None:
    av = pytest.importorskip("av")
    pytest.importorskip("cv2")
    robot = RecordedBench(tmp_path)
    robot.start(Mode.TRAIN, 0)
    for scene in range(60):  # pictures come at irregular times, one in ten late
        robot.step(scene, Action.FORWARD, seconds=0.19 if scene % 10 == 9 else 0.04)
    robot.stop()
    episode = robot.episode()
    write_look(episode, Notes(), tmp_path / "x.mp4")
    with av.open(str(tmp_path / "x.mp4")) as film:
        length_s = film.duration / av.time_base
    first, *_, last = episode.frames.values()
    assert length_s == pytest.approx(last.captured_s - first.captured_s, abs=0.1)


@pytest.mark.parametrize("name", ["film.txt", "film", "film.mcap", "film.mp4.bak"])
def test_a_file_name_that_is_not_a_films_is_refused_in_a_sentence(name: str) -> None:
    with pytest.raises(ConfigurationError, match=r"\.mp4"):
        check_suffix(Path(name))


def test_names_of_exports_have_no_spaces(storage: Storage) -> None:
    imported(storage.folder("episodes"), "our long hall", 1e9)
    for _ in range(2):
        assert main(["episodes", "export", "last", "--as", "tub"]) == 0
    names = sorted(path.name for path in storage.exports.iterdir())
    assert names == ["our-long-hall-tub", "our-long-hall-tub-2"]
