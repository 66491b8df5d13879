"""Pictures with labels in a table, in folders or in file names are imported, or refused clearly."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from robot.clock import RealClock
from robot.errors import RecordingError
from robot.exchange.drive import ImportReport, write_episode
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives, unpacked
from robot.recordings.episode import open_episode
from robot.types import DEFAULT_MOVES, Action

from .imported import (
    drive_at,
    import_from,
    labels_by_number,
    number_of,
    picture,
    put,
    taught_labels,
)

L, F, R = Action.LEFT, Action.FORWARD, Action.RIGHT
ABC = {"a.jpg": 1, "b.jpg": 2, "c.jpg": 3}
Labels = dict[int, Action | None]


@dataclass
class Data:
    """The files that a program wrote: texts, bytes, or pictures (as their numbers)."""

    files: dict[str, str | bytes | int]
    labels: Labels = field(default_factory=lambda: {1: L, 2: R, 3: F})
    """The label that each picture must have after the import."""
    reading: dict[str, Any] = field(default_factory=dict)
    archive: str = ""
    """The name of the zip that contains the files; empty if they are in a folder."""

    def write(self, home: Path) -> Path:
        folder = home / "set"
        for name, content in self.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, str):
                content = content.encode()
            elif isinstance(content, int):
                content = picture(content, path.suffix)
            path.write_bytes(content)
        if not self.archive:
            return folder
        packed = shutil.make_archive(str(home / "packed"), "zip", folder)
        return Path(packed).rename(home / self.archive)


def table(name: str, text: str, **reading: Any) -> Data:
    """A table and three pictures, at which the pilot turned left, turned right and drove on."""
    return Data({name: text, **ABC}, reading=reading)


UDACITY = "".join(
    f"{n}.jpg,left_{n}.jpg,right_{n}.jpg,{steering},1,0,9\n"
    for n, steering in {"a": -0.8, "b": 0.45, "c": 0.0}.items()
)
OPENBOT = {f"images/{number}_crop.jpeg": number for number in range(1, 6)}
DATA = {
    "labels": table("data.csv", "file,label\na.jpg,left\nb.jpg,RIGHT\nc.jpg,Forward\n"),
    "numbers for classes": table(
        "data.csv",
        "t;Image;Move\n1;a.jpg;1\n2;b.jpg;2\n3;c.jpg;0\n",
        moves={"0": F, "1": L, "2": R},
    ),
    "Roboflow": table(
        "_classes.csv",
        "filename, forward, left, right\na.jpg, 0, 1, 0\nb.jpg, 0, 0, 1\nc.jpg, 1, 0, 0\n",
    ),
    "true and false": table(
        "t.csv", "file,left,right,forward\na.jpg,TRUE,,\nb.jpg,,TRUE,\nc.jpg,False,False,1\n"
    ),
    "JSON": table("labels.json", '{"a.jpg": "left", "b.jpg": "right",\n "c.jpg": "forward"}'),
    "JSON of steering": table("d.json", '{"a.jpg": -0.5, "b.jpg": 0.5, "c.jpg": 0, "n": 3}'),
    "JSON of objects": table(
        "d.json",
        '{"a.jpg": {"steering": -1, "throttle": 0.5}, "b.jpg": {"steering": 1, "throttle": 0.5},'
        '\n "c.jpg": {"steering": 0.0, "throttle": 0.5}}',
    ),
    "Label Studio": table(
        "labels.json",
        '[{"image": "/data/a.jpg", "choice": "left"}, {"image": "b.jpg", "choice": "right"},'
        '\n {"image": "c.jpg", "choice": "forward"}]',
    ),
    "Hugging Face": table(
        "metadata.jsonl",
        '{"file_name": "a.jpg", "text": "left"}\n[]\n{"file_name": "b.jpg", "text": "right"}\n'
        '{"file_name": "c.jpg", "text": "forward"}',
    ),
    "a list": table("data.txt", "a.jpg -0.800000\nb.jpg  0.45\nc.jpg 0.0\n"),
    "S. Chen's list": table(
        "data.txt",
        "a.jpg -0.8,2018-07-01 17:09:44:912\nb.jpg 0.45,x y\nc.jpg 0.0,x y\n",
        columns={"steering": "2"},
    ),
    "without a header": table(
        "log.csv", "a.jpg,left,1700000000\nb.jpg,right,1700000001\nc.jpg,forward,1700000002\n"
    ),
    "a German spreadsheet": table(
        "LABELS.CSV",
        "\ufeffTime_ms;Steering [deg];Image\r\n"
        "100;-22,5;a.jpg\r\n150;20,1;b.jpg\r\n200;0,5;c.jpg\r\n",
        full_lock=25.0,
    ),
    "commas in a table with commas": table(
        "t.csv", '# by hand\nfile,angle\na.jpg,"-0,5"\nb.jpg,"+,5"\nc.jpg,\u22120.1\n'
    ),
    "a delimiter that Excel states": table(
        "t.csv",
        "sep=;\nfile;label,1\na.jpg;left\nb.jpg;right\nc.jpg;forward\n",
        columns={"label": "2"},
    ),
    "bars and NumPy's head": table(
        "t.csv", "# file|label\na.jpg|left\nb.jpg|right\nc.jpg|forward\n"
    ),
    "Excel's table of Windows": Data(
        {
            "t.csv": "file;label\n1\u00fc.jpg;left\n2\u00f1.jpg;right\n3.jpg;forward\n".encode(
                "cp1252"
            ),
            "1\u00fc.jpg": 1,
            "2\u00f1.jpg": 2,
            "3.jpg": 3,
        }
    ),
    "velocities in other units": table(
        "v.csv",
        "path,linear.x [cm/s],angular.z [deg/s]\na.jpg,20,20\nb.jpg,20,-20\nc.jpg,20,0.8\n",
    ),
    "wheels that are on or off": table(
        "w.csv", "file,left,right\na.jpg,0,1\nb.jpg,1,0\nc.jpg,1,1\n"
    ),
    "speeds of wheels": table(
        "w.tsv", "left_motor\tright_motor\tPath\n20\t200\ta.jpg\n180\t10\tb.jpg\n200\t200\tc.jpg\n"
    ),
    "velocities": table(
        "v.csv", "path,linear.x,angular.z\na.jpg,0.25,0.5\nb.jpg,0.25,-0.5\nc.jpg,0.25,0.05\n"
    ),
    "paths of another computer": Data(
        {
            "t.csv": "cam/image_array,user/angle,user/throttle,user/mode,timestamp\n"
            "C:\\Users\\x\\set\\in\\a.jpg,-0.7,0.4,user,2023-11-14 22:13:20.1\n"
            "C:\\Users\\x\\set\\in\\b.jpg,0.7,0.4,user,2023-11-14 22:13:20.2\n"
            ".\\in\\c.jpg,0,0.4,user,2023-11-14 22:13:20.3\n"
            "./in/stands.jpg,0.7,0,user,2023-11-14 22:13:20.4\n"
            "/home/x/set/in/pilot.jpg,0.7,0.4,local,2023-11-14 22:13:20.5\n",
            **{f"in/{name}": number for name, number in ABC.items()},
            "in/stands.jpg": 4,
            "in/pilot.jpg": 5,
            "a.jpg": 6,
        },
        {1: L, 2: R, 3: F, 4: None, 5: None},
    ),
    "a last row that may be cut": Data(
        {"t.csv": "file,angle\na.jpg,-1\nb.jpg,1\nc.jpg,0\nd.jpg,-0", **ABC, "d.jpg": 4}
    ),
    "pictures that are broken or missing": Data(
        {"t.csv": "file,angle\na.jpg,-1\ncut.jpg,0\nb.jpg,1\nno.jpg,0\nc.jpg,0\n", **ABC}
        | {"cut.jpg": picture(4)[:60]}
    ),
    "Udacity without a header": table("driving_log.csv", UDACITY),
    "Udacity": Data(
        {
            "driving_log.csv": "center,left,right,steering,throttle,brake,speed\n"
            + "".join(
                f"C:\\IMG\\center_2023_11_14_22_13_20_{n}00.jpg, IMG\\left_{n}.jpg, "
                f"IMG\\right_{n}.jpg, {log}\n"
                for n, log in enumerate(("-0.8,0.3,0,9", "1,0,0,9", "0,1,0,20", "0,0,0,1.2E-05"), 1)
            ),
            **{f"IMG/center_2023_11_14_22_13_20_{n}00.jpg": n for n in range(1, 5)},
            "IMG/left_1.jpg": 9,
        },
        {1: L, 2: R, 3: F, 4: None},
    ),
    "a course with a car that pulls to the left": Data(
        {
            "log_0.csv": "C:\\me\\IMG0\\Image_17000000001.jpg,-0.6\n"
            "C:\\me\\IMG0\\Image_1700000000123.jpg,0.5\nC:\\me\\IMG0\\Image_1700000001.jpg,-0.13\n",
            "IMG0/Image_17000000001.jpg": 1,
            "IMG0/Image_1700000000123.jpg": 2,
            "IMG0/Image_1700000001.jpg": 3,
        },
        reading={"trim": -0.13},
    ),
    "OpenBot's logs": Data(
        {
            **OPENBOT,
            "images/9_crop.jpeg": 9,
            "sensor_data/rgbFrames.txt": "timestamp[ns],frame\r\n"
            + "".join(f"10000000{n}0000000000,{of}\r\n" for n, of in enumerate((4, 1, 2, 3, 5), 4)),
            "sensor_data/ctrlLog.txt": "timestamp[ns],leftCtrl,rightCtrl\r\n"
            "1000000045000000000,50,200\r\n1000000055000000000,200,50\r\n"
            "1000000065000000000,200,200\r\n",
        },
        {4: None, 1: L, 2: R, 3: F, 5: F},
    ),
    "OpenBot's table": Data(
        {
            **OPENBOT,
            "sensor_data/matched_frame_ctrl_cmd_processed.txt": "timestamp,frame,left,right,cmd\n"
            "1000,/home/me/session/images/1_crop.jpeg,50,200,0\n"
            "2000,/home/me/session/images/2_crop.jpeg,200,50,0\n"
            "3000,/home/me/session/images/3_crop.jpeg,200,200,0\n",
        },
        archive="session.zip",
    ),
    "folders named as moves": Data(
        {"left/1.jpg": 1, "RIGHT/2.jpeg": 2, "forward/3.png": 3, ".ipynb_checkpoints/x.jpg": 9}
    ),
    "JetBot": Data(
        {"blocked/0f9d.jpg": 1, "free/1f9d.jpg": 2},
        {1: L, 2: F},
        {"moves": {"free": F, "blocked": L}},
        "jetbot.zip",
    ),
    "samples of Teachable Machine": Data({"0.jpg": 1}, {1: L}, archive="Left-samples.zip"),
    "samples of its second class": Data(
        {"0.jpg": 1}, {1: L}, {"moves": {"class_2": L}}, "Class 2 (1).zip"
    ),
    "a project of Teachable Machine": Data(
        {"Left-!-0.jpg": 1, "right-!-1.jpg": 2, "Class 1-!-2.jpg": 3}
        | {"manifest.json": '{"type": "image", "appdata": {"classes": []}}'},
        reading={"moves": {"class_1": F}},
        archive="lesson.tm",
    ),
    "steering in names": Data({"000001-0.50.jpg": 1, "0000020.50.jpg": 2, "0000030.00.jpg": 3}),
    "steering with a sign": Data({"000001-0.5.jpg": 1, "000002+0.5.jpg": 2, "000003+0.0.jpg": 3}),
    "steering after a dash": Data({"000001--0.5.jpg": 1, "000002-0.5.jpg": 2, "000003-0.1.jpg": 3}),
    "steering after a line": Data({"000001_-0.5.jpg": 1, "000002_0.5.jpg": 2, "000003_0.1.jpg": 3}),
}


@pytest.mark.parametrize("data", DATA.values(), ids=DATA)
def test_the_data_of_each_program_is_imported(data: Data, tmp_path: Path) -> None:
    report = ImportReport()
    with unpacked(data.write(tmp_path), tmp_path, report) as path:
        [source] = find_drives(path)
        write_episode(source.read(Reading(**data.reading), report), tmp_path / "got.mcap")
    episode = open_episode(tmp_path / "got.mcap")
    assert labels_by_number(episode) == data.labels, report.lines()
    times_s = [entry.captured_s for entry in episode.frames.values()]
    assert times_s == sorted(set(times_s))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a.jpg,0.5,0.3\nb.jpg,0.1,0.3\n", "the steering may be in column 2 or 3"),
        ("a.jpg,b.jpg,0.5\n", "2 columns contain picture names"),
        ("file,angle,steering\na.jpg,0.5,0.1\n", "which of 'angle' and 'steering' is the"),
        (
            "file,label\na.jpg,3\n",
            "'3' is not a move; assign it to a move with --moves, for example --moves 3=left",
        ),
        ("file,angle\na.jpg,17.5\n", "not from -1 to 1.*with --full-lock"),
        ("file,angle\na.jpg,0.3\nb.jpg,-20\nc.jpg,25\n", "goes from -20 to 25"),
        ("file,angle [rad]\na.jpg,0.4\n", "given in rad, not from -1 to 1; .*--full-lock"),
        ("file,label\n,left\n", "line 2: the row names no picture"),
        ("file,label\na.jpg,go up\n", '--moves "go up=left"'),
        ("a.jpg,0\nb.jpg,2\n", "column 2 may be a class or the steering"),
        (
            "file,left,right\na.jpg,1,0\nb.jpg,0,1\n",
            "'left' and 'right' may be moves or the speeds of two wheels",
        ),
        ("file,speed\na.jpg,1\n", "no column for a label.*its columns: file, speed"),
        # Damaged tables, of which nothing can be used.
        *(
            ("", "there is no column"),
            ("file,label\n", "has no rows"),
            ("a,b\n1,2\n", "no column"),
        ),
        *(("file,angle\na.jpg,nan\n", "'nan'"), ("file,label\na.jpg,fly\n", "'fly' is not a move")),
        ("file,label\nmissing.jpg,left\n", "the picture is missing"),
        ("file,label\n../secret.jpg,left\n", "leads out of"),
        ("file,label\n" + "x" * 200_000 + ",left\n", "cannot be read"),
    ],
)
def test_a_table_that_is_ambiguous_or_damaged_is_refused(
    tmp_path: Path, text: str, complaint: str
) -> None:
    put(tmp_path, "secret.jpg")
    folder = put(tmp_path / "set", *ABC)
    (folder / "log.csv").write_text(text)
    with pytest.raises(RecordingError, match=complaint):
        import_from(folder, tmp_path / "got.mcap")
    assert not (tmp_path / "got.mcap").exists()


@pytest.mark.parametrize(
    ("order", "is_sorted"),
    [
        ([3, 1, 4, 0, 5, 2, 7, 6, 8], True),
        ([8, 7, 6, 5, 4, 3, 2, 1, 0], True),
        ([6, 7, 8, 0, 1, 2, 3, 4, 5], False),
    ],
    ids=["shuffled", "the last first", "two sessions"],
)
def test_the_rows_of_a_shuffled_table_are_sorted_by_time(
    order: list[int], is_sorted: bool, tmp_path: Path
) -> None:
    names = [f"{number}.jpg" for number in range(9)]
    folder, report = put(tmp_path / "set", *names), ImportReport()
    rows = "".join(f"{n}.jpg,{n / 10},{('left', 'right', 'forward')[n % 3]}\n" for n in order)
    (folder / "t.csv").write_text(f"file,time,label\n{rows}")
    write_episode(drive_at(folder, report), tmp_path / "got.mcap")
    episode = open_episode(tmp_path / "got.mcap")
    shown = [number_of(episode.frame(each)) - 1 for each in episode.frames]
    assert shown == (sorted(order) if is_sorted else order)
    assert any("sorted by time" in line for line in report.lines()) is is_sorted
    if is_sorted:
        times_s = episode.frames.captured_s - episode.start_s
        assert list(times_s) == pytest.approx([n / 10 for n in range(9)], abs=1e-6)
        assert [*taught_labels(episode).values()] == [Action.LEFT, Action.RIGHT, Action.FORWARD] * 3


def test_a_table_may_begin_at_zero_or_state_times_of_day(tmp_path: Path) -> None:
    folder = put(tmp_path / "set", *ABC)
    for times in ("0,0 0,5 1,5", "23:59:59.5 24:00:00 24:00:01", "00:00.0 00:00.5 01:01.5"):
        rows = zip(ABC, ("left", "right", "forward"), times.split(" "), strict=True)
        text = "".join(";".join(row) + "\n" for row in [("file", "label", "time"), *rows])
        (folder / "t.csv").write_text(text)
        episode = import_from(folder, tmp_path / f"{times[:4].replace(':', '')}.mcap")
        after_s = [entry.captured_s - episode.start_s for entry in episode.frames.values()]
        assert after_s[:2] == pytest.approx([0.0, 0.5]), times
        assert float(episode.run["started_at_s"]) == 0.0, "the time is not a date"


@pytest.mark.parametrize(
    ("stamp", "began_s"),
    [
        *(("1700000000.5", 1700000000.5), ("1700000000500", 1700000000.5)),
        *(("2023-11-14 23:13:20.5+01:00", 1700000000.5), ("16e8", 1.6e9), ("5e9", 0.0)),
    ],
)
def test_a_drive_whose_times_are_dates_keeps_its_date(
    stamp: str, began_s: float, tmp_path: Path
) -> None:
    folder = put(tmp_path / "set", "a.jpg")
    (folder / "t.csv").write_text(f"file,label,time\na.jpg,left,{stamp}\n")
    assert import_from(folder, tmp_path / "got.mcap").started_at_s == began_s


def test_a_drive_keeps_its_date_on_a_computer_whose_clock_is_late(
    tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setattr(RealClock, "wall_s", lambda clock: 60.0)
    folder = put(tmp_path / "set", "a.jpg")
    (folder / "t.csv").write_text("file,label,time\na.jpg,left,1700000000.5\n")
    assert import_from(folder, tmp_path / "got.mcap").started_at_s == 1700000000.5


@pytest.mark.parametrize("name", ["table.csv", "table.txt"])
def test_a_table_of_windows_and_pictures_of_a_mac_fit_together(tmp_path: Path, name: str) -> None:
    """Excel writes UTF-16, and macOS stores accents as separate characters."""
    folder = put(tmp_path / "set", "man\u0303ana.jpg", "u\u0308ben.jpg")
    text = "file\tlabel\r\nma\u00f1ana.jpg\tleft\r\n\u00fcben.jpg\tright\r\n"
    (folder / name).write_bytes(text.encode("utf-16"))
    report = ImportReport()
    write_episode(drive_at(folder, report), tmp_path / "got.mcap")
    assert labels_by_number(open_episode(tmp_path / "got.mcap")) == {1: L, 2: R}
    assert not any("does not list" in line for line in report.lines())


def test_pictures_of_classes_that_are_not_imported_are_reported(tmp_path: Path) -> None:
    """Phones write HEIC, and some people sort pictures into further subfolders."""
    put(tmp_path / "set", "left/a.jpg", "right/b.HEIC", "left/more/c.jpg", "left/m/n/d.png")
    report = ImportReport()
    drive_at(tmp_path / "set", report)
    assert report.lines() == [
        "left out: 2 pictures in subfolders of classes",
        "skipped: 1",
        "  neither JPEG nor PNG (.heic): 1 files",
    ]


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        (["free/1.jpg", "blocked/2.jpg"], r"--moves .*blocked=MOVE,free=MOVE"),
        (["left/1.jpg", "other/2.jpg"], r"whose names are not moves: other \(1 pictures\);"),
        (["photos/1.jpg", "settings.json", "labels.txt"], "whose names are not moves"),
        (["keras_model.h5", "labels.txt"], "a model that was trained elsewhere"),
        (["drive.mp4"], "a film without labels"),
        (["left.zip"], "it contains archives"),
        (["notes.txt"], "text that is not a table of pictures"),
        (["a.xyz"], r"none of its files \(1 .xyz\) has a known format"),
        (["000001-0.50.jpg", "000002-0.10.jpg"], "may be a minus sign or a separator"),
        (["sensor_data/rgbFrames.txt"], "OpenBot without sensor_data/ctrlLog.txt"),
        (["xy_030_091_0f9d2c4e-1111-11ea.jpg"], "a target point"),
        (["drive.bag"], "the ROS bag .* cannot be read: .*repair it with: rosbag reindex"),
        (["drive.mcap"], "the ROS bag .* cannot be read: .*repair it with: mcap recover"),
        ([], "does not exist"),
    ],
)
def test_a_refusal_says_what_was_recognised_and_why(
    tmp_path: Path, names: list[str], complaint: str
) -> None:
    folder = put(tmp_path / "set", *names)
    with pytest.raises(RecordingError, match=complaint):
        drive_at(folder / "drive.mp4" if names == ["drive.mp4"] else folder)


@pytest.mark.parametrize("full_lock", [1.0, 100.0])
def test_a_hint_names_a_car_whose_straight_ahead_is_not_zero(
    full_lock: float, tmp_path: Path
) -> None:
    names = [f"{n}.jpg" for n in range(12)]
    angles = [full_lock * share for share in (-0.9, -0.13, -0.13, 0.1)] * 3
    rows = "".join(f"{n},{a}\n" for n, a in zip(names, angles, strict=True))
    folder, report = put(tmp_path / "set", *names), ImportReport()
    (folder / "log.csv").write_text(f"file,angle\n{rows}")
    write_episode(drive_at(folder, report, full_lock=full_lock), tmp_path / "a.mcap")
    [hint] = [line for line in report.lines() if "no example of right" in line]
    assert report.labels == {Action.FORWARD: 9, Action.LEFT: 3}
    trim = float(hint.rpartition("--trim ")[2])
    back = drive_at(folder, trim=trim, full_lock=full_lock)
    assert {shot.label for shot in back.shots} == {*DEFAULT_MOVES}


@pytest.mark.parametrize("head", ["file,angle", "file,angle,label"])
def test_no_trim_is_suggested_that_cannot_help(head: str, tmp_path: Path) -> None:
    """A pilot with a keyboard drove mostly left, or the labels do not depend on steering."""
    names = [f"{n}.jpg" for n in range(12)]
    angles = [-1, -1, 0] * 4 if head == "file,angle" else [-0.9, -0.5, -0.5] * 4
    labels = ["" if head == "file,angle" else f",{move}" for move in ("left", "forward")] * 6
    rows = [f"{n},{a}{label}" for n, a, label in zip(names, angles, labels, strict=True)]
    folder, report = put(tmp_path / "set", *names), ImportReport()
    (folder / "log.csv").write_text("\n".join([head, *rows, ""]))
    write_episode(drive_at(folder, report), tmp_path / "a.mcap")
    assert report.labels[Action.LEFT] and not report.labels[Action.RIGHT]
    assert not any("import again" in line for line in report.lines())
