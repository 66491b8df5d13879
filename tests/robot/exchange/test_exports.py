"""Each export can be read by the tools for its format. test_lerobot.py tests LeRobot's datasets."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import av
import numpy as np
import pytest

from robot.errors import ConfigurationError, RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.files import check_suffix
from robot.exchange.film import _BAR_PX, SUFFIXES, _captioned, write_film, write_look
from robot.exchange.folder import write_folder
from robot.exchange.lerobot import CAMERA, write_lerobot
from robot.exchange.npz import write_npz
from robot.exchange.own import copy_recording
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives
from robot.exchange.tub import write_tub
from robot.policy.image import to_rgb
from robot.policy.registry import make_policy
from robot.recordings.editing import EpisodeFrame, write_edited
from robot.recordings.edits import Edit, Notes, trim
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.teaching import learn_again
from robot.types import Action, Mode
from tests.robot.recordings.drives import RecordedBench

from .imported import import_pictures, pixels


def shown_in(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as film:
        return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]


def test_a_folder_has_its_labels_where_imagefolder_looks_for_them(
    episode: Episode, tmp_path: Path
) -> None:
    write_folder(episode, Notes(), tmp_path / "folder")
    with (tmp_path / "folder/metadata.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(episode.frames)
    assert all((tmp_path / "folder" / row["file_name"]).is_file() for row in rows)
    taught = [str(example.label) for example in taught_frames(episode).values()]
    assert [row["label"] for row in rows if row["label"]] == taught
    assert len(find_drives(tmp_path / "folder")) == 1


def test_pictures_of_several_sizes_are_all_kept_and_every_reader_takes_them(tmp_path: Path) -> None:
    """A camera changes its resolution and is turned while it is recorded."""
    shots = [pixels(n % 13) for n in range(45)]
    shots[15:30] = [shot.repeat(2, axis=0).repeat(2, axis=1) for shot in shots[15:30]]
    shots[30:] = [np.ascontiguousarray(np.rot90(shot)) for shot in shots[30:]]
    labels = [(Action.LEFT, Action.FORWARD)[n // 5 % 2] for n in range(45)]
    several = import_pictures(tmp_path / "several.mcap", shots, labels)
    ids = list(several.frames)
    assert {entry.size for entry in several.frames.values()} == {(160, 120), (320, 240), (120, 160)}
    report = learn_again(make_policy("default-8"), [(several, Notes())])
    assert (report.missing_frames, report.taught.total()) == (0, 45)

    assert write_tub(several, Notes(), tmp_path / "tub") == 45
    assert write_npz(several, Notes(), tmp_path / "x.npz") == 45
    assert write_look(several, Notes(), tmp_path / "film.mp4") == 45
    turned = Notes(edits=(Edit(verb="delete", ranges=((ids[0], ids[32]),)),))
    write_lerobot([(several, Notes()), (several, turned)], tmp_path / "set")
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    assert info["features"][CAMERA]["shape"] == [120, 160, 3]
    films = sorted((tmp_path / "set/videos").rglob("*.mp4"))
    assert len(films) == 2
    for film in films:
        assert {picture.shape for picture in shown_in(film)} == {(120, 160, 3)}
    for source in (*find_drives(tmp_path / "tub"), *find_drives(tmp_path / "set")):
        told = ImportReport()
        drive = source.read(Reading(threshold=0.1), told)
        assert write_episode(drive, tmp_path / f"{source.name}.mcap") > 0
        assert told.skipped == []


def test_a_tub_without_a_taught_picture_is_refused_and_all_may_be_exported(tmp_path: Path) -> None:
    seen = import_pictures(tmp_path / "seen.mcap", [pixels(1), pixels(2)], [None, None])
    with pytest.raises(RecordingError, match="--all"):
        write_tub(seen, Notes(), tmp_path / "taught")
    assert write_tub(seen, Notes(), tmp_path / "all", taught_only=False) == 2


def test_a_film_to_look_at_plays_as_long_as_the_drive(episode: Episode, tmp_path: Path) -> None:
    count = write_look(episode, Notes(), tmp_path / "film.mp4")
    shown = shown_in(tmp_path / "film.mp4")
    assert len(shown) == count == len(episode.frames)
    for frame_id, picture in zip(episode.frames, shown, strict=True):
        seen, bar = np.split(picture, [480])
        in_four = [seen[i::4, i::4].astype(int) for i in (1, 2)]  # the picture, four times as large
        taken = to_rgb(episode.frame(frame_id))
        assert max(np.abs(each - taken).mean() for each in in_four) < 6
        assert np.abs(bar[:, -50:].astype(int) - 24).max() < 6
        assert bar[:, :200].max() > 200
    with av.open(str(tmp_path / "film.mp4")) as film:
        length_s = film.duration / av.time_base
    first, *_, last = episode.frames.values()
    assert length_s == pytest.approx(last.captured_s - first.captured_s, abs=0.1)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (161, 213), (479, 641), (240, 320)])
def test_a_film_shows_the_colours_of_pictures_of_any_size(height: int, width: int) -> None:
    """Pictures of odd sizes, enlarged by odd and even factors."""
    colour = np.array([200, 40, 90], np.uint8)
    picture = np.full((height, width, 3), colour)
    moment = EpisodeFrame(frame_id=1, at_s=0.0, label=None, is_relabelled=False, is_deleted=False)
    shown = _captioned(picture, moment).to_ndarray(format="rgb24")
    assert shown.shape[0] >= 480 and not shown.shape[0] % 2 and not shown.shape[1] % 2
    assert np.abs(shown[:-_BAR_PX].astype(int) - colour).max() < 5


def test_a_film_needs_pictures_of_more_than_one_row_and_the_name_of_a_film(
    episode: Episode, tmp_path: Path
) -> None:
    ids, path = list(episode.frames), tmp_path / "film.mp4"
    notes = Notes().with_edit(Edit(verb="delete", ranges=((ids[0], ids[-1]),)))
    with pytest.raises(RecordingError, match="no pictures"):
        write_look(episode, notes, path)
    for sides in ((1, 8), (8, 1)):
        with pytest.raises(RecordingError, match="two pixels"):
            write_film([np.zeros((*sides, 3), np.uint8)], path, 10)
    for name in ("film.txt", "film", "film.mcap", "film.mp4.bak"):
        with pytest.raises(ConfigurationError, match=r"\.mp4"):
            check_suffix(Path(name), "a film", SUFFIXES)


def test_measurements_stay_with_every_copy_and_export(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.recorder.write_result("lost", {})  # no recording exists yet
    robot.start(Mode.TRAIN, 0)
    for scene in range(30):
        robot.step(scene, Action.FORWARD)
        if scene == 20:
            robot.recorder.write_result("race", {"metres": 1.5, "not": math.nan, "who": [1]})
    episode = robot.episode()
    [result] = episode.results
    assert result.pop("at_s") == pytest.approx(20 / 30 * episode.duration_s, abs=0.2)
    assert result == {"of": "race", "metres": 1.5}
    with (tmp_path / "edited.mcap").open("wb") as file:
        write_edited(episode, Notes(edits=(trim(episode.frames, 10, 29),)), file)
    copy_recording(episode.path, tmp_path / "copy.mcap", ImportReport())
    for name in ("edited", "copy"):
        assert [one["metres"] for one in open_episode(tmp_path / f"{name}.mcap").results] == [1.5]
    write_tub(episode, Notes(), tmp_path / "tub")
    write_folder(episode, Notes(), tmp_path / "folder")
    write_lerobot([(episode, Notes())], tmp_path / "set")
    write_npz(episode, Notes(), tmp_path / "one.npz")
    tub = json.loads((tmp_path / "tub/manifest.json").read_text().splitlines()[2])
    [row] = json.loads((tmp_path / "set/meta/drivelesson_results.json").read_text())
    assert row.pop("episode") == episode.id
    assert tub["drivelesson_results"] == [row] == episode.results
    assert json.loads((tmp_path / "folder/results.json").read_text()) == episode.results
    assert json.loads(str(np.load(tmp_path / "one.npz")["meta"]))["results"] == episode.results
