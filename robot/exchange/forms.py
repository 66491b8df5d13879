"""The formats that can be imported: how each is recognised and read, and what its values mean.

The import, its error messages and the documentation use this table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from robot.errors import RecordingError
from robot.exchange.classes import (
    are_classes,
    are_steered,
    is_project,
    read_class,
    read_classes,
    read_project,
    read_steered,
)
from robot.exchange.drive import Drive, ImportReport
from robot.exchange.files import PICTURES, files_ending, folders_in
from robot.exchange.folder import TABLE
from robot.exchange.lerobot_reader import LerobotDataset
from robot.exchange.npz import load_recording
from robot.exchange.openbot import is_openbot, read_openbot
from robot.exchange.own import copy_recording, is_own
from robot.exchange.reading import Reading
from robot.exchange.rosbag import is_bag, read_bag
from robot.exchange.steering import FULL_MPS, FULL_TURN_RAD_S
from robot.exchange.table import ANY_TEXT, ENDINGS, names_pictures, read_table
from robot.exchange.tub import read_tub
from robot.exchange.tub_records import is_tub
from robot.recordings.parts import is_part

Read = Callable[[Reading, ImportReport], Drive]
_NO_TIME = "none; the command assumes 20 pictures a second, and says so"


class Source(NamedTuple):
    """A drive that was found: its name for people, and the function that reads the drive.

    The function raises RecordingError if no picture can be used, and MissingExtraError if a package
    for the format is not installed. The pictures themselves are read only when the drive is
    written. A recording of this program needs no conversion, so its source has a function `copy`,
    which the import calls instead of `read`. Its arguments are the new file's path and the report.
    """

    name: str
    read: Read
    copy: Callable[[Path, ImportReport], int] | None = None


Find = Callable[[Path], Sequence[Source] | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """One format of data.

    Attributes:
        name: The format's name for people.
        there: The format's files on the disk.
        label: Where the label comes from, with sign, unit and range.
        time: Where the time comes from.
        find: Returns the drives at a path, or None if the path does not have this format. The
            function must be quick, so it does not check the data for damage.
        is_whole: True if the format has typical files by which it is recognised. The other formats
            would match nearly any folder, so they are tried last.
    """

    name: str
    there: str
    label: str
    time: str
    find: Find
    is_whole: bool = True


def refusing(path: Path, why: str) -> Source:
    """Return a source that is recognised but cannot be imported, for the reason `why`."""

    def read(reading: Reading, report: ImportReport) -> Drive:
        raise RecordingError(f"{path} {why}")

    return Source(path.name, read)


def _one(is_it: Callable[[Path], bool], read: Callable[..., Drive]) -> Find:
    """Return a function for `Form.find`. The returned function returns one drive if `is_it` is true
    for the path, and None otherwise."""

    def find(path: Path) -> list[Source] | None:
        return [Source(path.name, partial(read, path))] if is_it(path) else None

    return find


def _folder(is_it: Callable[[Path], bool]) -> Callable[[Path], bool]:
    return lambda path: path.is_dir() and is_it(path)


def _find_lerobot(path: Path) -> list[Source] | None:
    if not (path / "meta/info.json").is_file():
        return None
    dataset = LerobotDataset(path)
    found = [Source(f"{path.name} {n}", partial(dataset.read, n)) for n in dataset.episodes()]
    return found or [refusing(path, dataset.why_empty())]


def _find_tables(path: Path) -> list[Source] | None:
    if path.is_file():
        is_table = path.suffix.lower() in ENDINGS and _is_no_other_text(path)
        return [Source(path.name, partial(read_table, path))] if is_table else None
    tables = [file for file in files_ending(path, *ENDINGS) if _is_no_other_text(file)]
    # Drivelesson exported this folder: `frames.csv` contains all data of the other tables
    if path / TABLE in tables:
        tables = [path / TABLE]
    if len(tables) > 1 or (tables and (are_classes(path) or are_steered(path))):
        tables = [table for table in tables if names_pictures(table)]
    several = len(tables) > 1
    return [
        Source(f"{path.name} {at.name}" if several else path.name, partial(read_table, at))
        for at in tables
    ] or None


def _is_no_other_text(path: Path) -> bool:
    return path.suffix.lower() not in ANY_TEXT or names_pictures(path)


def _find_recording(path: Path) -> list[Source] | None:
    if path.suffix.lower() != ".mcap" or not path.is_file() or not is_own(path):
        return None
    if is_part(path):
        return None  # imported together with the first file of the recording
    refused = refusing(path, "is a recording of this program; it is copied")
    return [Source(path.name, refused.read, partial(copy_recording, path))]


def _find_npz(path: Path) -> list[Source] | None:
    is_npz = path.suffix.lower() == ".npz" and path.is_file() and not path.name.startswith("_")
    return [Source(path.name, lambda _, report: load_recording(path, report))] if is_npz else None


def _holds_classes(path: Path) -> bool:
    """True if the subfolders are classes, and none of them is a drive by itself."""
    return are_classes(path) and not any(
        form.find(each) for each in folders_in(path) for form in FORMS if form.is_whole
    )


def _has_pictures(path: Path) -> bool:
    return bool(files_ending(path, *PICTURES))


FORMS: tuple[Form, ...] = (
    Form(
        name="LeRobot dataset",
        there="`meta/info.json`, version 2.0, 2.1 or 3.0; films or pictures",
        label="the elements of the action, by name: `angle` or `steering` and `throttle` (-1 to 1, "
        "right and ahead positive); `linear_velocity` and `angular_velocity` (EarthRover Mini: -1 "
        "to 1, left positive); `x.vel` (m/s) and `theta.vel` (degrees a second, left positive: "
        "LeKiwi); `linear.x` (m/s) and `angular.z` (radians a second, left positive: ROS); or one "
        "element for each move",
        time="`timestamp`, in seconds of the episode, at the rate of the dataset",
        find=_find_lerobot,
    ),
    Form(
        name="Teachable Machine project",
        there="`.tm`: `manifest.json` and `CLASS-!-N.jpg`",
        label="the class, if its name is a move, or if `--moves` assigns a move to it",
        time=_NO_TIME,
        find=_one(_folder(is_project), read_project),
    ),
    Form(
        name="donkeycar tub",
        there="version 1: `record_N.json`; version 2: `manifest.json` and `*.catalog`",
        label="`user/angle` and `user/throttle`, -1 to 1, right and ahead positive; only "
        "where `user/mode` is `user`; deleted records are left out",
        time="`_timestamp_ms` (since 1970) or `milliseconds` (since the start), or else "
        "`timestamp`, a date and time; otherwise 20 pictures a second are assumed",
        find=_one(_folder(is_tub), read_tub),
    ),
    Form(
        name="OpenBot session",
        there="`images/N_crop.jpeg`, `sensor_data/rgbFrames.txt` and `ctrlLog.txt`, or its "
        "notebook's `matched_frame_ctrl_cmd_processed.txt`",
        label="the speeds of the left and right wheel, -255 to 255, ahead positive; each applies "
        "until the next; if the left wheel is faster, the robot turns right",
        time="in nanoseconds",
        find=_one(_folder(is_openbot), read_openbot),
    ),
    Form(
        name="ROS bag",
        there="ROS 1: `.bag`; ROS 2: a folder with `metadata.yaml`, or one `.db3` or `.mcap`; "
        "`CompressedImage` or `Image`, and `Twist` or `TwistStamped` (choose them with `--topics`)",
        label=f"`linear.x` in m/s, ahead positive, {FULL_MPS:g} is full throttle; `angular.z` "
        f"in rad/s, left positive, {FULL_TURN_RAD_S:.3f} (45 degrees a second) is full lock; a "
        "velocity applies until the next one",
        time="when the bag received the message, in nanoseconds",
        find=_one(is_bag, read_bag),
    ),
    Form(
        name="recording of this program",
        there="one `.mcap` file of another robot, with the file of its edits if there is one",
        label="as recorded; nothing is changed",
        time="as recorded",
        find=_find_recording,
    ),
    Form(
        name="npz",
        there="a `.npz` file of `drivelesson evaluate`: `jpeg`, `offsets`, `labels` and `t`",
        label="0: forward, 1: left, 2: right; `angle` and `throttle`, -1 to 1, right and ahead "
        "positive",
        time="`t`, in seconds",
        find=_find_npz,
    ),
    Form(
        name="table of pictures",
        there="`.csv`, `.tsv`, `metadata.jsonl`, `.json` (a list of objects; or a label, a "
        "steering value or an object for each picture), or a `.txt` with a list; with or without "
        "column names; such as Udacity's "
        "`driving_log.csv`, Hugging Face's `metadata.csv`, Roboflow's `_classes.csv` or Label "
        "Studio's export. The pictures are in the same folder or its subfolders; the program finds "
        "them by the last parts of their paths",
        label="a column, by its name: a move (`label`, `move`, `action`, `choice`); or a column "
        "for each move, with 1 or 0; or steering (`angle`, "
        "`steering`, `user/angle`: -1 to 1, right positive, unless `--full-lock` says otherwise) "
        "with `throttle` and `speed`; or left and right wheel (ahead positive); or linear and "
        "angular velocity (m/s, rad/s, left positive)",
        time="a column with seconds, milliseconds, nanoseconds or dates; or the pictures' names, "
        "with ten digits of seconds followed by the fraction, or with a date",
        find=_find_tables,
    ),
    Form(
        name="steering in pictures' names",
        there="`000123-0.50.jpg`: six digits and the steering",
        label="-1 to 1, right positive; all names together show whether the dash is a minus sign",
        time=_NO_TIME,
        find=_one(_folder(are_steered), read_steered),
    ),
    Form(
        name="folders named as moves",
        there="folders `forward/`, `left/`, `right/` and so on, as in `imagefolder`; JetBot's "
        "`free/` and `blocked/` with `--moves free=forward,blocked=left`",
        label="the name of the folder",
        time=_NO_TIME,
        find=_one(_folder(_holds_classes), read_classes),
        is_whole=False,
    ),
    Form(
        name="pictures of one move",
        there="a folder or archive with the name of a move, such as samples of Teachable Machine",
        label="the name of the folder or archive",
        time=_NO_TIME,
        find=_one(_folder(_has_pictures), read_class),
        is_whole=False,
    ),
)
"""All formats, in the order in which they are tried."""

UNUSABLE: dict[tuple[str, ...], str] = {
    (".h5", ".keras", ".tflite", ".pb", ".onnx", ".pt", ".pth", ".safetensors", "model.json"): (
        "a model that was trained elsewhere: Drivelesson cannot use it, and it contains no "
        "pictures to learn from; import the pictures that it was trained with"
    ),
    (".mp4", ".avi", ".mov", ".mkv", ".webm"): (
        "a film without labels: it does not contain the right move for each picture"
    ),
    (".hdf5", ".tfrecord", ".tfrec", ".parquet", ".arrow"): (
        "tables in the format of another program; export the pictures and a CSV table with the "
        "right move for each picture"
    ),
    (".pkl", ".pickle", ".npy"): (
        "Python data, which may run code when it is read; save the pictures and a CSV table with "
        "the right move for each picture"
    ),
    (".zip", ".tar", ".gz", ".7z", ".rar"): "it contains archives: unpack them, and import each",
    (".heic", ".heif", ".avif", ".webp", ".bmp", ".gif", ".tif", ".tiff"): (
        "pictures that are neither JPEG nor PNG"
    ),
    (".json", ".xml", ".txt", ".yaml", ".csv"): "text that is not a table of pictures",
}
"""Maps the suffixes of files that cannot be imported to the reason why."""
