"""Reads donkeycar tubs of versions 1 and 2, and writes tubs of version 2.

A tub of version 1 is a folder with files `record_N.json`, each next to its picture. A tub of
version 2 contains:

- `manifest.json`: names of inputs, types of inputs, metadata, more metadata and catalogs, one line
  of JSON each
- `images/`: the pictures
- `catalog_N.catalog`: one JSON record per line
- `catalog_N.catalog_manifest`: the lengths of the lines of this catalog

Source: donkeycar, parts/tub_v2.py and parts/datastore_v2.py.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

from robot.errors import RecordingError
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import PICTURES, files_ending, read_picture_file, write_picture
from robot.exchange.reading import Reading
from robot.exchange.stamps import date_or_zero, seconds_of
from robot.exchange.steering import (
    LabelAndPoints,
    check_unit,
    point_or_none,
    read_meant,
    read_number,
    read_point,
)
from robot.exchange.tub_records import (
    IMAGE,
    MOVES,
    RESULTS,
    Record,
    own_name,
    read_first,
    read_second,
)
from robot.moves import point_of
from robot.recordings.editing import EpisodeFrame, moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.recordings.messages import Topic
from robot.types import Action, Point

_ANGLE, _THROTTLE, _MODE = "user/angle", "user/throttle", "user/mode"
_STEERED = _ANGLE, _THROTTLE
_WRITTEN_TIME = "timestamp"
_PILOT = "pilot/angle", "pilot/throttle"
_LABEL, _FRAME = "drivelesson/label", "drivelesson/frame"
_CORRECTION, _DEGREES = "drivelesson/correction", "drivelesson/degrees"
_INPUTS = {
    IMAGE: "image_array",
    _ANGLE: "float",
    _THROTTLE: "float",
    **dict.fromkeys(_PILOT, "float"),
    _MODE: "str",
    _LABEL: "str",
    _FRAME: "int",
    **dict.fromkeys((_CORRECTION, _DEGREES), "boolean"),
}
_CATALOG_RECORDS = 1000
_encode = json.JSONEncoder(allow_nan=False, sort_keys=True).encode


def read_tub(folder: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read a tub. The pictures are not read now, but one by one when the imported recording is
    written.

    A record has no label if the autopilot drove, or if the driver is unknown. Raises
    RecordingError if no record can be used.
    """
    is_first = any(folder.glob("record_*.json")) and not (folder / "manifest.json").is_file()
    found, moves = (read_first(folder, report), None) if is_first else read_second(folder, report)
    pictures = folder if is_first else folder / "images"
    check_unit((r.get(_ANGLE) for _, r in found if _LABEL not in r), _ANGLE, reading)

    def read(place: str, record: Record) -> FrameEvent:
        label, point, does = _label_of(record, reading, moves)
        return FrameEvent(
            place=place,
            t_s=_time(record),
            steering=None if _LABEL in record else _written(record),
            label=label,
            point=point,
            does=does,
            picture=partial(read_picture_file, pictures, own_name(record[IMAGE])),
            is_intervention=record.get(_CORRECTION) is True,
            is_others=_LABEL not in record and not _is_by_pilot(record),
        )

    if is_first:
        named = {own_name(record[IMAGE]) for _, record in found}
        extra = [each for each in files_ending(folder, *PICTURES) if each.name not in named]
        report.remark(f"pictures without a record: {len(extra)}" if extra else None)
    return drive_of(
        found,
        read,
        f"the tub {folder} has no records",
        name=folder.name,
        source="donkeycar tub v1" if is_first else "donkeycar tub v2",
        started_at_s=max((_began(record) for _, record in found[:1]), default=0.0),
        report=report,
    )


def _is_by_pilot(record: Record) -> bool:
    """True if the record names the user as the driver, or no driver at all, like old tubs."""
    return str(record.get(_MODE, "user")).strip().lower() == "user"


def _label_of(record: Record, reading: Reading, moves: Sequence[str] | None) -> LabelAndPoints:
    """Return the label of a record; raises ValueError if it is missing or invalid."""
    if _LABEL in record:  # this program wrote the tub
        text = record[_LABEL]
        if not isinstance(text, str) or (text and moves is not None and text not in moves):
            raise ValueError(f"{_LABEL} is {str(text)[:40]!r}, not one of the moves")
        written = [record.get(name) for name in _STEERED]
        if not text or record.get(_DEGREES) is not True:
            return Action(text) if text else None, None, point_or_none(written)
        return Action(text), read_point(written, _STEERED), None
    written = [record.get(name) for name in _STEERED if name in record or name == _ANGLE]
    meant = read_meant(written, reading, _STEERED)
    return (*meant, None) if _is_by_pilot(record) else (None, None, None)


def _written(record: Record) -> float | None:
    angle = record.get(_ANGLE)
    if isinstance(angle, bool) or not isinstance(angle, int | float):
        return None
    return angle


def _time(record: Record) -> float | None:
    """Return the time of a record, from its first valid field. Version 2 has milliseconds since
    1970; version 1 has milliseconds since the tub's start, a date, or nothing."""
    stamps_ms = (_seconds(record.get(name)) for name in ("_timestamp_ms", "milliseconds"))
    known = next((stamp for stamp in stamps_ms if stamp is not None), None)
    return seconds_of(record.get(_WRITTEN_TIME)) if known is None else known


def _began(record: Record) -> float:
    """Return the start of a tub, in seconds since 1970; 0 if unknown."""
    begin_s = _seconds(record.get("_timestamp_ms"))
    return begin_s or seconds_of(record.get(_WRITTEN_TIME)) or 0.0


def _seconds(stamp_ms: Any) -> float | None:
    with contextlib.suppress(ValueError):
        number = read_number(stamp_ms, "the time")
        since_1970_s = date_or_zero(number)  # some programs write seconds into these fields
        return since_1970_s or (number / 1000 if 0 <= number < 1e14 else None)
    return None


def write_tub(episode: Episode, notes: Notes, folder: Path, *, taught_only: bool = True) -> int:
    """Write an episode as a tub of version 2; return its number of records.

    Pictures are written without loss, as their JPEG bytes or as PNG. Each record also contains the
    label, the frame id, and whether the label was a correction. An import of the tub therefore
    yields the same examples with any threshold for turns. If the pilot steered proportionally, the
    record says so, and contains the pilot's angle and throttle. If the pilot pressed a button, the
    record contains the usual angle and throttle of that move. If the robot has a move without
    steering and throttle, such as `push`, the tub has no columns for angle and throttle: from zeros
    in these columns, a car would learn to stand still. The robot's proposal is in `pilot/angle` and
    `pilot/throttle`. `taught_only` leaves out frames that were not taught. Raises RecordingError if
    no picture is left.
    """
    folder.mkdir(parents=True)
    with tempfile.TemporaryFile("w+", dir=folder, encoding="ascii", newline="\n") as lines:
        seen = _write_records(episode, notes, folder, lines, taught_only=taught_only)
        if not seen.count:
            raise RecordingError(
                "there are no pictures to export: none is an example; to export all, add --all"
                if taught_only
                else "there are no pictures to export: all are deleted"
            )
        lines.seek(0)
        _write_catalogs(folder, lines, episode, seen)
    return seen.count


@dataclass(slots=True)
class _Seen:
    """Summary of a tub's records: their number, columns and labels."""

    count: int = 0
    columns: set[str] = field(default_factory=set)
    labels: set[str] = field(default_factory=set)
    all_steered: bool = True

    @property
    def inputs(self) -> dict[str, str]:
        there = self.columns if self.all_steered else self.columns - {*_STEERED, _DEGREES}
        return {name: of for name, of in _INPUTS.items() if name in there}


def _write_records(
    episode: Episode, notes: Notes, folder: Path, lines: TextIO, *, taught_only: bool
) -> _Seen:
    """Write pictures, and a line of JSON for each record."""
    seen, origin_ms = _Seen(), episode.origin_ns // 10**6
    declared = tuple(episode.declared_moves)
    pointed = cache(lambda move: point_of(Action(move), declared))
    pictures = folder / "images"
    about = (Topic.PREDICTION,) if taught_only else (Topic.PREDICTION, Topic.DECISION)
    for moment in moments(episode, notes, about):
        if moment.is_deleted or (taught_only and moment.label is None):
            continue
        frame, index = episode.frame(moment.frame_id), seen.count
        record: Record = {
            IMAGE: write_picture(frame, pictures, f"{index}_cam_image_array_"),
            _MODE: "user" if moment.label else "local",
            _LABEL: moment.label or "",
            _FRAME: moment.frame_id,
            _CORRECTION: moment.is_intervention,
            "_index": index,
            "_session_id": "drivelesson_0",
            "_timestamp_ms": origin_ms + round(frame.captured_s * 1000),
        }
        if point := _done(moment, pointed):
            record.update(zip(_STEERED, point, strict=True))
        if moment.point is not None:
            record[_DEGREES] = True
        proposed = moment.predicted_point
        if proposed is None and moment.predicted:
            proposed = pointed(moment.predicted)
        if proposed:
            record.update(zip(_PILOT, proposed, strict=True))
        lines.write(_as_line(record))
        seen.count += 1
        if not record.keys() <= seen.columns:
            seen.columns |= record.keys()
        if moment.label:
            seen.labels.add(moment.label)
        seen.all_steered &= _ANGLE in record
    return seen


def _done(moment: EpisodeFrame, pointed: Callable[[str], Point | None]) -> Point | None:
    """Return the steering and throttle at a picture, by the same rule as `done_at`. `pointed`
    returns the steering and throttle of a move."""
    point = moment.point if moment.label else moment.sent_point
    return point or pointed(moment.label or moment.sent or Action.STOP)


def _as_line(record: Record) -> str:
    return _encode(record) + "\n"


def _write_catalogs(folder: Path, records: Iterable[str], episode: Episode, seen: _Seen) -> None:
    created_s, names, inputs = episode.started_at_s, [], seen.inputs
    moves, rest = sorted(seen.labels), iter(records)
    for start in range(0, max(seen.count, 1), _CATALOG_RECORDS):
        stem = f"catalog_{start // _CATALOG_RECORDS}"
        lines = list(islice(rest, _CATALOG_RECORDS))
        if not seen.all_steered:
            lines = [_as_line(_without_steering(json.loads(line))) for line in lines]
        (folder / f"{stem}.catalog").write_text("".join(lines), encoding="ascii", newline="\n")
        described = {
            "path": f"{stem}.catalog_manifest",
            "created_at": created_s,
            "start_index": start,
            "line_lengths": [len(line) for line in lines],
        }
        _write_lines(folder / f"{stem}.catalog_manifest", [described])
        names.append(f"{stem}.catalog")
    sessions = {
        "all_full_ids": ["drivelesson_0"],
        "last_id": 0,
        "last_full_id": "drivelesson_0",
    }
    catalogs = {
        "paths": names,
        "current_index": seen.count,
        "max_len": _CATALOG_RECORDS,
        "deleted_indexes": [],
    }
    _write_lines(
        folder / "manifest.json",
        [
            list(inputs),
            list(inputs.values()),
            {
                "drivelesson_episode": episode.id,
                MOVES: moves,
                **({RESULTS: episode.results} if episode.results else {}),
            },
            {"created_at": created_s, "sessions": sessions},
            catalogs,
        ],
    )


def _without_steering(record: Record) -> Record:
    return {name: value for name, value in record.items() if name not in (*_STEERED, _DEGREES)}


def _write_lines(path: Path, values: list[Any]) -> None:
    text = "".join(_encode(value) + "\n" for value in values)
    path.write_text(text, encoding="ascii", newline="\n")
