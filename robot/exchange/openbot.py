"""Reads OpenBot sessions: pictures, and the commands to both wheels. The import reads these files:

    images/N_crop.jpeg                                       the picture of frame N
    sensor_data/rgbFrames.txt                                timestamp[ns],frame
    sensor_data/ctrlLog.txt                                  timestamp[ns],leftCtrl,rightCtrl
    sensor_data/matched_frame_ctrl_cmd_processed.txt         by its notebook: path, left, right, cmd

Commands to the wheels range from -255 to 255; positive is ahead. A command is valid until the next
one.

Source: ob-f/OpenBot, policy/openbot and the app's logger.
"""

from __future__ import annotations

import bisect
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from robot.errors import RecordingError
from robot.exchange.columns import is_picture_name
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import Pictures, read_picture_file, read_text
from robot.exchange.reading import Reading
from robot.exchange.steering import at_wheels, read_number

FULL_WHEEL = 255.0
_LOGS = "sensor_data"
_FRAMES, _CONTROLS = "rgbFrames.txt", "ctrlLog.txt"
_MATCHED = "matched_frame_ctrl_cmd_processed.txt", "matched_frame_ctrl_cmd.txt"
Fields = list[str]
Row = tuple[str, Fields]
"""A line of a log: its location, for the import's report, and its fields."""


def is_openbot(folder: Path) -> bool:
    """True for the folder of a session, even an incomplete session."""
    logs = folder / _LOGS
    return any((logs / name).is_file() for name in (_FRAMES, _CONTROLS, *_MATCHED))


def read_openbot(folder: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read a session from its logs, or else from the table that OpenBot's notebook made from
    them."""
    logs = folder / _LOGS
    matched = next((logs / name for name in _MATCHED if (logs / name).is_file()), None)
    if (logs / _FRAMES).is_file() and (logs / _CONTROLS).is_file():
        return _by_logs(folder, logs, reading, report)
    if matched is None:
        lost = _CONTROLS if (logs / _FRAMES).is_file() else _FRAMES
        raise RecordingError(f"{folder} is a session of OpenBot without {_LOGS}/{lost}")
    return _by_table(folder, matched, reading, report)


def _by_logs(folder: Path, logs: Path, reading: Reading, report: ImportReport) -> Drive:
    controls: list[tuple[float, float, float]] = []
    for place, fields in _rows(logs / _CONTROLS, report, 3):
        try:
            stamp, left, right = (read_number(field, "a control") for field in fields[:3])
        except ValueError as error:
            report.skip(place, str(error))
            continue
        controls.append((stamp, left, right))
    controls.sort(key=lambda control: control[0])
    stamps = [control[0] for control in controls]
    names = {number: path.name for path in _pictures(folder) if (number := _number_of(path))}

    def read(place: str, fields: Fields) -> FrameEvent:
        stamp, number = read_number(fields[0], "the time"), fields[1].strip()
        at = bisect.bisect_right(stamps, stamp) - 1
        label, point = (None, None)
        if at >= 0:
            _, left, right = controls[at]
            label, point = at_wheels(left / FULL_WHEEL, right / FULL_WHEEL, reading)
        name = names.get(number.lstrip("0") or "0", f"{number}_crop.jpeg")
        return FrameEvent(
            place=place,
            t_s=stamp / 1e9,
            label=label,
            point=point,
            picture=partial(read_picture_file, folder / "images", name),
        )

    rows = list(_rows(logs / _FRAMES, report, 2))
    extra = len(names) - len({fields[1].strip().lstrip("0") or "0" for _, fields in rows})
    if extra > 0:
        report.remark(f"pictures without a line in {_FRAMES}: {extra}")
    return _drive(folder, rows, read, report)


def _by_table(folder: Path, table: Path, reading: Reading, report: ImportReport) -> Drive:
    pictures = Pictures(folder)

    def read(place: str, fields: Fields) -> FrameEvent:
        at = next((i for i, field in enumerate(fields) if is_picture_name(field)), None)
        if at is None or len(fields) < at + 3:
            raise ValueError("the line must contain a picture's name, then two wheel speeds")
        left, right = (read_number(of, "a wheel") / FULL_WHEEL for of in fields[at + 1 : at + 3])
        label, point = at_wheels(left, right, reading)
        name = pictures.find(fields[at])
        return FrameEvent(
            place=place,
            t_s=read_number(fields[0], "the time") / 1e9 if at else None,
            label=label,
            point=point,
            picture=partial(read_picture_file, folder, name),
        )

    return _drive(folder, _rows(table, report, 3), read, report)


def _drive(
    folder: Path, rows: list[Row], read: Callable[[str, Fields], FrameEvent], report: ImportReport
) -> Drive:
    return drive_of(
        rows,
        read,
        f"the session {folder} has no frames",
        name=folder.name,
        source="OpenBot",
        report=report,
    )


def _rows(path: Path, report: ImportReport, width: int) -> list[Row]:
    """Return the fields of a log's lines, except the header line."""
    rows = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        fields = [field for field in re.split(r"[,\s]+", line.strip()) if field]
        if not fields or line.startswith("#") or not re.match(r"-?\d", fields[0]):
            continue
        if len(fields) < width:
            report.skip(f"{path.name} line {number}", "the line is incomplete")
        else:
            rows.append((f"{path.name} line {number}", fields))
    return rows


def _pictures(folder: Path) -> list[Path]:
    images = folder / "images"
    return sorted(images.iterdir()) if images.is_dir() else []


def _number_of(path: Path) -> str:
    """Return a frame's number from its picture's name, `12_crop.jpeg` or `12_preview.jpeg`."""
    match = re.fullmatch(r"0*(\d+)(?:_crop|_preview)?\.(?:jpe?g|png)", path.name, re.IGNORECASE)
    return match[1] if match else ""
