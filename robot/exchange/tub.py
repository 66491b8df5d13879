"""Tubs of donkeycar: versions 1 and 2 are read, version 2 is written.

A tub 1 is a folder of `record_N.json`, each beside its picture. A tub 2 has `manifest.json` (five
lines of JSON: names of inputs, their types, metadata, more metadata, catalogs), `catalog_N.catalog`
with one JSON record a line, a `.catalog_manifest` with the lengths of these lines beside each, and
`images/`. Source: donkeycar, parts/tub_v2.py and parts/datastore_v2.py.
"""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from robot.devices.pictures import read_picture_file, write_picture
from robot.driver import CLASSIC, Move, Point, point_of
from robot.errors import RecordingError
from robot.exchange.drive import Drive, Shot, moves_with
from robot.exchange.steering import DEFAULT_THRESHOLD, to_move
from robot.store.episodes.editing import moments
from robot.store.episodes.edits import Notes
from robot.store.episodes.episode import Episode
from robot.types import Action

_IMAGE, _ANGLE, _THROTTLE, _MODE = "cam/image_array", "user/angle", "user/throttle", "user/mode"
_LABEL, _FRAME = "drivelesson/label", "drivelesson/frame"
_CORRECTION = "drivelesson/correction"
_INPUTS = {
    _IMAGE: "image_array",
    _ANGLE: "float",
    _THROTTLE: "float",
    _MODE: "str",
    _LABEL: "str",
    _FRAME: "int",
    _CORRECTION: "boolean",
}
_CATALOG_RECORDS = 1000
_MOST_TEXT_BYTES = 64 * 2**20
Record = dict[str, Any]


def is_tub(folder: Path) -> bool:
    """True if the folder looks like a tub of either version."""
    return (folder / "manifest.json").is_file() or any(folder.glob("record_*.json"))


def read_tub(folder: Path, threshold: float = DEFAULT_THRESHOLD) -> Drive:
    """Read a tub; its pictures are read when the drive is written.

    Raises:
        RecordingError: If it is not a tub, or broken.
    """
    is_second = (folder / "manifest.json").is_file()
    records = _read_second(folder) if is_second else _read_first(folder)
    if not records:
        raise RecordingError(f"the tub {folder} has no records")
    pictures = folder / "images" if is_second else folder
    labels = [_label(record, threshold) for record in records]
    times_s = _times_s(records)
    return Drive(
        name=folder.name,
        source="donkeycar tub v2" if is_second else "donkeycar tub v1",
        shots=_shots(pictures, records, times_s, labels),
        moves=moves_with(labels),
        declared_moves=_declared(records, labels),
        started_at_s=_started_at_s(records),
    )


def _shots(
    pictures: Path, records: list[Record], times_s: list[float], labels: list[Action | None]
) -> Iterator[Shot]:
    for record, t_s, label in zip(records, times_s, labels, strict=True):
        picture = read_picture_file(pictures, str(record[_IMAGE]))
        is_correction = record.get(_CORRECTION) is True
        yield Shot(t_s=t_s, picture=picture, label=label, is_intervention=is_correction)


def _label(record: Record, threshold: float) -> Action | None:
    if _LABEL in record:  # a tub of ours
        return _own_label(record[_LABEL])
    throttle = record.get(_THROTTLE)
    try:
        return to_move(
            float(record[_ANGLE]), None if throttle is None else float(throttle), threshold
        )
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"a record of the tub has no usable {_ANGLE}: {error}") from error


def _own_label(text: Any) -> Action | None:
    try:
        return Action(text) if text else None
    except ValueError as error:
        raise RecordingError(f"a record of the tub has a broken {_LABEL}: {error}") from error


def _declared(records: list[Record], labels: list[Action | None]) -> tuple[Move, ...]:
    """Return steering and throttle of the driver's own moves, as in a tub that we wrote."""
    found: dict[Action, Move] = {}
    for record, label in zip(records, labels, strict=True):
        if _LABEL in record and label is not None and label not in CLASSIC | found:
            with contextlib.suppress(KeyError, TypeError, ValueError):
                steering, throttle = float(record[_ANGLE]), float(record[_THROTTLE])
                found[label] = Move(label, steering=steering, throttle=throttle)
    return tuple(found.values())


def _times_s(records: list[Record]) -> list[float]:
    """Return seconds from the first record; twenty a second where no times were written."""
    stamps = [record.get("_timestamp_ms", record.get("milliseconds")) for record in records]
    times_s = [stamp / 1000 for stamp in stamps if isinstance(stamp, int | float)]
    if len(times_s) == len(records) and all(a <= b for a, b in pairwise(times_s)):
        return [at_s - times_s[0] for at_s in times_s]
    return [index / 20 for index in range(len(records))]


def _started_at_s(records: list[Record]) -> float:
    stamp = records[0].get("_timestamp_ms")
    return stamp / 1000 if isinstance(stamp, int | float) and 0 < stamp < 1e14 else 0.0


def _read_first(folder: Path) -> list[Record]:
    numbered = []
    for path in folder.glob("record_*.json"):
        match = re.fullmatch(r"record_(\d{1,12})\.json", path.name)
        if match:
            numbered.append((int(match[1]), path))
    return [_checked(_parse(_read_text(path), path), path) for _, path in sorted(numbered)]


def _read_second(folder: Path) -> list[Record]:
    manifest = folder / "manifest.json"
    lines = [line for line in _read_text(manifest).splitlines() if line.strip()]
    if len(lines) < 5:
        raise RecordingError(f"{manifest} has {len(lines)} lines; a tub's has five")
    catalogs = _parse(lines[4], manifest)
    try:
        names, deleted = list(catalogs["paths"]), {int(i) for i in catalogs["deleted_indexes"]}
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(f"{manifest} is damaged: {error}") from error
    records = []
    for name in names:
        if not isinstance(name, str) or Path(name).name != name:
            raise RecordingError(f"{str(name)[:80]!r} in {manifest} leads out of the tub")
        path = folder / name
        for line in _read_text(path).splitlines():
            if line.strip():
                records.append(_checked(_parse(line, path), path))
    return [r for i, r in enumerate(records) if r.get("_index", i) not in deleted]


def _read_text(path: Path) -> str:
    try:
        if path.stat().st_size > _MOST_TEXT_BYTES:
            raise RecordingError(f"{path} is too large")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


def _parse(text: str, path: Path) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{path} is damaged: {error}") from error


def _checked(record: Any, path: Path) -> Record:
    if not isinstance(record, dict) or not isinstance(record.get(_IMAGE), str):
        raise RecordingError(f"a record in {path} names no picture ({_IMAGE})")
    return record


def write_tub(
    episode: Episode,
    notes: Notes,
    folder: Path,
    *,
    taught_only: bool = True,
    on_frame: Callable[[], None] = lambda: None,
) -> int:
    """Write an episode as a tub 2; return how many records it has.

    Pictures keep their bytes (JPEG) or their pixels (PNG). Each record also has the label, the
    frame id and whether the label corrected the robot, so that reading the tub again gives the
    same examples, whatever the threshold. Angle and throttle are what the driver declared of each
    move; where a move has none, as `push`, the tub has no such columns: a zero would teach a car
    to stand.

    Args:
        episode: What is exported.
        notes: Its edits.
        folder: A new folder.
        taught_only: Leave out the pictures that nobody taught.
        on_frame: Called for each picture.
    """
    folder.mkdir(parents=True)
    origin_ms = episode.origin_ns // 10**6
    records: list[Record] = []
    points: list[Point | None] = []
    for moment in moments(episode, notes):
        on_frame()
        if moment.is_deleted or (taught_only and moment.label is None):
            continue
        frame = episode.frame(moment.frame_id)
        done = moment.label or Action(moment.sent or Action.STOP)
        points.append(point_of(done, episode.declared_moves))
        index = len(records)
        records.append(
            {
                _IMAGE: write_picture(frame, folder / "images", f"{index}_cam_image_array_"),
                _MODE: "user" if moment.label else "local",
                _LABEL: moment.label or "",
                _FRAME: moment.frame_id,
                _CORRECTION: moment.is_intervention,
                "_index": index,
                "_session_id": "drivelesson_0",
                "_timestamp_ms": origin_ms + round(frame.captured_s * 1000),
            }
        )
    is_steered = None not in points
    if is_steered:
        for record, point in zip(records, points, strict=True):
            assert point is not None
            record[_ANGLE], record[_THROTTLE] = point
    inputs = {n: kind for n, kind in _INPUTS.items() if is_steered or n not in (_ANGLE, _THROTTLE)}
    _write_catalogs(folder, records, episode, inputs)
    return len(records)


def _write_catalogs(
    folder: Path, records: list[Record], episode: Episode, inputs: dict[str, str]
) -> None:
    created_s = episode.started_at_s
    names = []
    for start in range(0, max(len(records), 1), _CATALOG_RECORDS):
        stem = f"catalog_{start // _CATALOG_RECORDS}"
        part = records[start : start + _CATALOG_RECORDS]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) + "\n" for record in part]
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
        "current_index": len(records),
        "max_len": _CATALOG_RECORDS,
        "deleted_indexes": [],
    }
    _write_lines(
        folder / "manifest.json",
        [
            list(inputs),
            list(inputs.values()),
            {"drivelesson_episode": episode.id},
            {"created_at": created_s, "sessions": sessions},
            catalogs,
        ],
    )


def _write_lines(path: Path, values: list[Any]) -> None:
    text = "".join(json.dumps(value, allow_nan=False, sort_keys=True) + "\n" for value in values)
    path.write_text(text, encoding="ascii", newline="\n")
