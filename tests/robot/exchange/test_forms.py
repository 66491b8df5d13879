"""Data in every format is imported correctly, or refused with a true sentence."""

from __future__ import annotations

import json
import os
import random
import shutil
from pathlib import Path

import pytest

from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.files import read_head
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives, unpacked
from robot.exchange.table import names_pictures
from robot.recordings.episode import open_episode
from robot.recordings.messages import Topic
from robot.types import Action

from .imported import drive_at, taught_labels
from .made import MAKERS, number_of, put
from .sim_drive import drive_in_simulator

UDACITY = "".join(
    f"{n}.jpg,left_{n}.jpg,right_{n}.jpg,{steering},1,0,9\n"
    for n, steering in {"a": -0.8, "b": 0.45, "c": 0.0}.items()
)
VARIANTS = int(os.environ.get("DRIVELESSON_FORMS", 30 if "DRIVELESSON_FULL" in os.environ else 3))


@pytest.mark.parametrize("form", MAKERS)
def test_each_variant_of_a_format_is_imported_correctly(form: str, tmp_path: Path) -> None:
    for seed in range(VARIANTS):
        home, report = tmp_path / str(seed), ImportReport()
        home.mkdir()
        made = MAKERS[form](random.Random(f"{form} {seed}"), home)
        with unpacked(made.path, home, report) as path:
            [source] = find_drives(path)
            write_episode(source.read(Reading(**made.reading), report), home / "got.mcap")
        episode = open_episode(home / "got.mcap")
        labels = taught_labels(episode)
        times_s = [entry.captured_s for entry in episode.frames.values()]
        assert times_s == sorted(set(times_s))
        found = {number_of(episode.frame(i)): labels.get(i) for i in episode.frames}
        true = {number: label for number, label in made.truth.items() if number not in made.damaged}
        assert found == true, (seed, report.lines())
        shutil.rmtree(home)


def table_of(folder: Path, text: str, *names: str) -> Path:
    for number, name in enumerate(names or ("a.jpg", "b.jpg", "c.jpg")):
        put(folder, name, number)
    (folder / "log.csv").write_text(text)
    return folder


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a.jpg,0.5,0.3\nb.jpg,0.1,0.3\n", "the steering may be in column 2 or 3"),
        ("a.jpg,b.jpg,0.5\n", "2 columns name pictures"),
        ("file,angle,steering\na.jpg,0.5,0.1\n", "which of 'angle' and 'steering' is the"),
        (
            "file,label\na.jpg,3\n",
            "'3' is not a move; assign it to a move with --moves, for example --moves 3=left",
        ),
        ("file,angle\na.jpg,17.5\n", "not from -1 to 1.*with --full-lock"),
        ("file,angle\na.jpg,0.3\nb.jpg,-20\nc.jpg,25\n", "goes from -20 to 25"),
        ("a.jpg,0\nb.jpg,2\n", "column 2 may be a class or the steering"),
        (
            "file,left,right\na.jpg,1,0\nb.jpg,0,1\n",
            "'left' and 'right' may be moves or the speeds of two wheels",
        ),
        ("file,speed\na.jpg,1\n", "no column for a label.*its columns: file, speed"),
    ],
)
def test_if_columns_are_ambiguous_the_import_asks(
    tmp_path: Path, text: str, complaint: str
) -> None:
    with pytest.raises(RecordingError, match=complaint):
        drive_at(table_of(tmp_path / "set", text))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (
            "_classes.csv",
            "filename, forward, left, right\na.jpg, 0, 1, 0\nb.jpg, 0, 0, 1\nc.jpg, 1, 0, 0",
        ),
        ("table.csv", "file,left,right,forward\na.jpg,TRUE,,\nb.jpg,,TRUE,\nc.jpg,False,False,1"),
        ("labels.json", '{"a.jpg": "left", "b.jpg": "right",\n "c.jpg": "forward"}'),
        (
            "labels.json",
            '[{"image": "/data/a.jpg", "choice": "left"},\n {"image": "b.jpg", "choice": "right"}, '
            '{"image": "c.jpg", "choice": "forward"}]',
        ),
        ("data.txt", "a.jpg -0.800000\nb.jpg  0.45\nc.jpg 0.0"),
        ("data.txt", "a.jpg -0.8,2018-07-01 17:09:44:912\nb.jpg 0.45,x y\nc.jpg 0.0,x y"),
        (
            "project.csv",
            "id,choice,image\n3,left,/data/a.jpg\n4,right,/data/b.jpg\n5,forward,/data/c.jpg",
        ),
        ("wheels.csv", "file,left,right\na.jpg,0,1\nb.jpg,1,0\nc.jpg,1,1"),
        ("driving_log.csv", UDACITY.rstrip()),
    ],
)
def test_tables_of_other_programs_are_imported(tmp_path: Path, name: str, text: str) -> None:
    """Roboflow, S. Chen's, Label Studio's and Udacity's tables, and wheels that are on or off."""
    for number, picture in enumerate(("a.jpg", "b.jpg", "c.jpg")):
        put(tmp_path / "set", picture, number)
    (tmp_path / "set" / name).write_text(f"{text}\n")
    columns = {"steering": "2"} if ",2018" in text else {}
    drive = drive_at(tmp_path / "set", columns=columns)
    assert [shot.label for shot in drive.shots] == [Action.LEFT, Action.RIGHT, Action.FORWARD]


@pytest.mark.parametrize("name", ["table.csv", "table.txt"])
def test_a_table_of_windows_and_pictures_of_a_mac_fit_together(tmp_path: Path, name: str) -> None:
    """Excel writes UTF-16, and macOS separates the accents from their letters."""
    folder = table_of(tmp_path / "set", "", "man\u0303ana.jpg", "u\u0308ben.jpg")
    (folder / "log.csv").unlink()
    text = "file\tlabel\r\nma\u00f1ana.jpg\tleft\r\n\u00fcben.jpg\tright\r\n"
    (folder / name).write_bytes(text.encode("utf-16"))
    report = ImportReport()
    drive = drive_at(folder, report)
    write_episode(drive, tmp_path / "got.mcap")
    labels = taught_labels(open_episode(tmp_path / "got.mcap"))
    assert list(labels.values()) == [Action.LEFT, Action.RIGHT]
    assert not any("does not list" in line for line in report.lines())


def test_pictures_of_classes_that_are_not_imported_are_reported(tmp_path: Path) -> None:
    """Phones write HEIC, and some people sort pictures into further subfolders."""
    for number, name in enumerate(
        ("left/a.jpg", "right/b.HEIC", "left/more/c.jpg", "left/m/n/d.png")
    ):
        put(tmp_path / "set", name, number)
    report = ImportReport()
    drive_at(tmp_path / "set", report)
    assert report.lines() == [
        "left out: 2 pictures in subfolders of the classes",
        "skipped: 1",
        "  neither JPEG nor PNG (.heic): 1 files",
    ]


def test_the_option_columns_decides_what_columns_mean(tmp_path: Path) -> None:
    folder = table_of(tmp_path / "set", "a.jpg,0.9,-0.3\nb.jpg,0.9,0.3\nc.jpg,0.9,0\n")
    drive = drive_at(folder, columns={"steering": "3"})
    assert [shot.label for shot in drive.shots] == [Action.LEFT, Action.RIGHT, Action.FORWARD]


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        (["free/1.jpg", "blocked/2.jpg"], r"--moves .*blocked=MOVE,free=MOVE"),
        (["left/1.jpg", "other/2.jpg"], r"whose names are not moves: other \(1 pictures\);"),
        (["photos/1.jpg"], "whose names are not moves"),
        (["keras_model.h5", "labels.txt"], "a model that was trained elsewhere"),
        (["drive.mp4"], "a film without labels"),
        (["left.zip"], "it contains archives"),
        (["a.xyz"], "it holds 1 of .xyz, none of a known form"),
        (["000001-0.50.jpg", "000002-0.10.jpg"], "may be a minus sign or a separator"),
        (["sensor_data/rgbFrames.txt"], "OpenBot without sensor_data/ctrlLog.txt"),
        (["xy_030_091_0f9d2c4e-1111-11ea.jpg"], "a point to drive to"),
        (["photos/1.jpg", "settings.json"], "not moves"),
        (["photos/1.jpg", "labels.txt"], "whose names are not moves"),
        (["drive.bag"], "the ROS bag .* cannot be read"),
        (["drive.mcap"], "the ROS bag .* cannot be read"),
    ],
)
def test_a_refusal_says_what_was_recognised_and_why(
    tmp_path: Path, names: list[str], complaint: str
) -> None:
    for number, name in enumerate(names):
        put(tmp_path / "set", name, number)
    with pytest.raises(RecordingError, match=complaint):
        [source] = find_drives(tmp_path / "set")
        source.read(Reading(), ImportReport())


def test_a_dataset_that_was_never_finalized_is_named_as_such(tmp_path: Path) -> None:
    info = {"codebase_version": "v3.0", "fps": 10, "features": {}}
    for path in ("meta", "data/chunk-000"):
        (tmp_path / "set" / path).mkdir(parents=True)
    (tmp_path / "set/meta/info.json").write_text(json.dumps(info))
    (tmp_path / "set/data/chunk-000/file-000.parquet").write_bytes(b"PAR1 and no end")
    [source] = find_drives(tmp_path / "set")
    with pytest.raises(RecordingError, match="never finalized"):
        source.read(Reading(), ImportReport())


def test_a_car_whose_straight_on_is_not_zero_is_hinted_at_and_trimmed(tmp_path: Path) -> None:
    names = [f"{n}.jpg" for n in range(12)]
    angles = [-0.9, -0.13, -0.13, 0.1] * 3
    rows = "".join(f"{n},{a}\n" for n, a in zip(names, angles, strict=True))
    folder, report = table_of(tmp_path / "set", f"file,angle\n{rows}", *names), ImportReport()
    write_episode(drive_at(folder, report), tmp_path / "a.mcap")
    [hint] = [line for line in report.lines() if "no example of right" in line]
    assert "--trim -0.13" in hint and report.labels == {Action.FORWARD: 9, Action.LEFT: 3}
    report = ImportReport()
    write_episode(drive_at(folder, report, trim=-0.13), tmp_path / "b.mcap")
    assert report.labels == {Action.FORWARD: 6, Action.LEFT: 3, Action.RIGHT: 3}


def test_a_recording_of_another_robot_is_the_same_and_an_import(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    path = drive_in_simulator(tmp_path / "other", "default-8", steps=40).path
    report, target = ImportReport(), tmp_path / "mine.mcap"
    [source] = find_drives(path)
    assert source.copy is not None
    given = open_episode(path)
    assert source.copy(target, report) == len(given.frames)
    back = open_episode(target)
    assert back.run == {**given.run, "source": "recording of another robot"}
    for topic in set(Topic) - {Topic.CAMERA, Topic.POSE}:  # protobuf, not JSON
        assert [*back.messages(topic)] == [*given.messages(topic)], topic
    assert [*given.events] and repr([*back.events]) == repr([*given.events])
    assert back.attachments == given.attachments and not back.damage
    assert all(back.frame(i) == given.frame(i) for i in given.frames)
    assert sum(report.labels.values()) == len(taught_labels(given)) > 0


def test_the_kind_of_a_text_is_found_from_its_first_lines(tmp_path: Path) -> None:
    """A list may have any length, and a log beside pictures, too."""
    path = tmp_path / "list.txt"
    for text in ("1.jpg 0.5", "1.jpg 0.5\n" * 10**5, "x" * 10**6):
        path.write_text(text)
        head = read_head(path)
        assert text.startswith(head) and 0 < len(head) <= 2**18
        assert "\n" not in text or head.endswith("\n")
        assert names_pictures(path) == text.startswith("1.jpg")
