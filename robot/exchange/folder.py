"""A folder of pictures with a CSV table, which any program can read."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from robot.devices.pictures import read_picture_file, write_picture
from robot.driver import CLASSIC, Move, describe, from_text, names, point_of, to_text
from robot.errors import RecordingError
from robot.exchange.drive import Drive, Shot, moves_with, read_label
from robot.exchange.steering import DEFAULT_THRESHOLD, to_move
from robot.store.episodes.editing import moments
from robot.store.episodes.edits import Notes
from robot.store.episodes.episode import Episode
from robot.types import Action

TABLE, MOVES = "frames.csv", "moves.json"
COLUMNS = (
    "file",
    "frame",
    "time_s",
    "label",
    "angle",
    "predicted",
    "confidence",
    "driven_by",
    "sent",
    "correction",
)
_FILE = ("file", "image", "filename", "path", "img", "image_path")
_LABEL = ("label", "move", "action", "class")
_ANGLE = ("angle", "steering", "user/angle", "steering_angle")
_THROTTLE = ("throttle", "user/throttle", "speed")
_TIME = ("time_s", "t", "time", "timestamp", "seconds")
_MOST_TABLE_BYTES, _MOST_MOVES_BYTES = 64 * 2**20, 2**20


def write_folder(
    episode: Episode,
    notes: Notes,
    folder: Path,
    *,
    taught_only: bool = False,
    on_frame: Callable[[], None] = lambda: None,
) -> int:
    """Write an episode as pictures and `frames.csv`; return how many pictures there are.

    `moves.json` has the driver's declared moves, so that its own labels are recognised.
    """
    folder.mkdir(parents=True)
    declared = describe(episode.moves, episode.declared_moves)
    (folder / MOVES).write_text(to_text(declared), encoding="utf-8")
    rows = 0
    with (folder / TABLE).open("x", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for moment in moments(episode, notes):
            on_frame()
            if moment.is_deleted or (taught_only and moment.label is None):
                continue
            frame = episode.frame(moment.frame_id)
            point = point_of(moment.label, episode.declared_moves) if moment.label else None
            name = write_picture(frame, folder / "images", f"{moment.frame_id:08d}")
            table.writerow(
                (
                    f"images/{name}",
                    moment.frame_id,
                    f"{moment.at_s:.6f}",
                    moment.label or "",
                    "" if point is None else point[0],
                    moment.predicted or "",
                    "" if moment.confidence is None else f"{moment.confidence:.4f}",
                    moment.driven_by or "",
                    moment.sent or "",
                    "yes" if moment.is_intervention else "",
                )
            )
            rows += 1
    return rows


def read_folder(
    folder: Path, threshold: float = DEFAULT_THRESHOLD, table: Path | None = None
) -> Drive:
    """Read a folder of pictures with a CSV table of one row a picture.

    The table has a column for the file (`file`, `image`, `filename`, `path`), one for the label
    (`label`, `move`, `action`) or the steering angle (`angle`, `steering`), and may have one for
    the seconds (`time_s`, `t`, `timestamp`), and one that says `yes` where the pilot corrected
    the robot (`correction`).

    Raises:
        RecordingError: If there is no such table, or more than one, or it is broken.
    """
    path = table or _find_table(folder)
    rows = _read_rows(path)
    declared = _read_moves(path.with_name(MOVES))
    known = {*CLASSIC, *names(declared)}
    labels = [_label(row, threshold, path, known) for row in rows]
    return Drive(
        name=folder.name,
        source="folder",
        shots=_shots(folder, rows, labels, path),
        moves=moves_with(labels),
        declared_moves=declared,
    )


def _read_moves(path: Path) -> tuple[Move, ...]:
    if not path.is_file():
        return ()
    try:
        if path.stat().st_size > _MOST_MOVES_BYTES:
            raise ValueError("it is too large")
        return from_text(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


def _find_table(folder: Path) -> Path:
    tables = sorted(folder.glob("*.csv"))
    if len(tables) != 1:
        raise RecordingError(f"the folder {folder} has {len(tables)} CSV tables; it must have one")
    return tables[0]


def _read_rows(path: Path) -> list[dict[str, str]]:
    try:
        if path.stat().st_size > _MOST_TABLE_BYTES:
            raise RecordingError(f"the table {path} is too large")
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [
                {(k or "").strip().lower(): v or "" for k, v in row.items() if isinstance(v, str)}
                for row in csv.DictReader(file)
            ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"the table {path} cannot be read: {error}") from error
    if not rows:
        raise RecordingError(f"the table {path} has no rows")
    if _find(rows[0], _FILE) is None:
        raise RecordingError(f"the table {path} has no column {' or '.join(_FILE[:4])}")
    if _find(rows[0], _LABEL) is None and _find(rows[0], _ANGLE) is None:
        raise RecordingError(f"the table {path} has no column label or angle")
    return rows


def _find(row: dict[str, str], names: tuple[str, ...]) -> str | None:
    return next((row[name] for name in names if name in row), None)


def _label(
    row: dict[str, str], threshold: float, path: Path, known: Collection[Action]
) -> Action | None:
    text = _find(row, _LABEL)
    if text is not None and not text.strip():
        return None
    label = read_label(text, known)
    if label is not None:
        return label
    angle = _find(row, _ANGLE)
    if text is not None and angle is None:
        raise RecordingError(f"the table {path} has a label {text[:40]!r} that is not a move")
    throttle = _find(row, _THROTTLE)
    return to_move(_number(angle, path), _number(throttle, path) if throttle else None, threshold)


def _number(text: str | None, path: Path) -> float:
    try:
        number = float(text or "")
    except ValueError as error:
        raise RecordingError(f"the table {path} has {text!r} where a number belongs") from error
    if not math.isfinite(number):
        raise RecordingError(f"the table {path} has {text!r} where a number belongs")
    return number


def _shots(
    folder: Path, rows: list[dict[str, str]], labels: list[Action | None], table: Path
) -> Iterator[Shot]:
    first_s: float | None = None
    last_s = 0.0
    for index, (row, label) in enumerate(zip(rows, labels, strict=True)):
        time_text = _find(row, _TIME)
        t_s = _number(time_text, table) if time_text else index / 20
        first_s = t_s if first_s is None else first_s
        last_s = max(t_s - first_s, last_s)
        name = _find(row, _FILE) or ""
        picture = read_picture_file(folder, name)
        is_correction = row.get("correction") == "yes"
        yield Shot(t_s=last_s, picture=picture, label=label, is_intervention=is_correction)
