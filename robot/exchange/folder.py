"""A folder of pictures with a CSV table, which any program can read."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from robot.driver import CLASSIC, Move, describe, from_text, names, to_text
from robot.errors import RecordingError, told_as
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import files_ending, read_picture_file, read_text, write_picture
from robot.exchange.steering import ANGLES, THROTTLES, Meant, done_at, read_meant, read_point
from robot.recordings.editing import moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode
from robot.types import Action

TABLE, MOVES = "frames.csv", "moves.json"
COLUMNS = (
    *("file", "frame", "time_s", "label", "angle", "throttle", "degrees"),
    *("predicted", "confidence", "driven_by", "sent", "correction"),
)
_FILE = ("file", "image", "filename", "path", "img", "image_path")
_LABEL = ("label", "move", "action", "class")
_TIME = ("time_s", "t", "time", "timestamp", "seconds")
Cells = dict[str, str]


def write_folder(episode: Episode, notes: Notes, folder: Path) -> int:
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
            if moment.is_deleted:
                continue
            frame = episode.frame(moment.frame_id)
            point = done_at(moment, episode.declared_moves)[1] if moment.label else None
            name = write_picture(frame, folder / "images", f"{moment.frame_id:08d}")
            table.writerow(
                (
                    f"images/{name}",
                    moment.frame_id,
                    f"{moment.at_s:.6f}",
                    moment.label or "",
                    *(point or ("", "")),
                    "" if moment.point is None else "yes",
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
    folder: Path,
    threshold: float,
    report: ImportReport,
    table: Path | None = None,
) -> Drive:
    """Read a folder of pictures with a CSV table of one row a picture.

    The table has a column for the file (`file`, `image`, `filename`, `path`), one for the label
    (`label`, `move`, `action`) or the steering angle (`angle`, `steering`), and may have one for
    the seconds (`time_s`, `t`, `timestamp`), and ones that say `yes` where the pilot corrected
    the robot (`correction`) or steered by degrees (`degrees`). A row that cannot be used is
    skipped; RecordingError if none can be used, or if there is not exactly one such table.
    """
    path = table or _find_table(folder)
    found = _read_rows(path, report)
    moves, declared = path.with_name(MOVES), tuple[Move, ...]()
    if moves.is_file():
        with told_as(RecordingError, f"{moves} cannot be read", ValueError):
            declared = from_text(read_text(moves))
    known = {str(move): move for move in (*CLASSIC, *names(declared))}

    def read(place: str, cells: Cells) -> FrameEvent:
        label, point = _meant(cells, threshold, known)
        return FrameEvent(
            place=place,
            t_s=_seconds(_find(cells, _TIME)),
            label=label,
            point=point,
            picture=partial(read_picture_file, folder, _find(cells, _FILE) or ""),
            is_intervention=cells.get("correction") == "yes",
        )

    return drive_of(
        found,
        read,
        f"the table {path} has no rows",
        name=folder.name,
        source="folder",
        declared_moves=declared,
        report=report,
    )


def _find_table(folder: Path) -> Path:
    tables = files_ending(folder, ".csv")
    if len(tables) != 1:
        raise RecordingError(f"the folder {folder} has {len(tables)} CSV tables; it must have one")
    return tables[0]


def _read_rows(path: Path, report: ImportReport) -> list[tuple[str, Cells]]:
    """Return the whole rows, and where each stands."""
    text = read_text(path)
    reader = csv.DictReader(io.StringIO(text, newline=""))
    with told_as(RecordingError, f"the table {path} cannot be read", csv.Error):
        columns = {(name or "").strip().lower() for name in reader.fieldnames or ()}
    if not columns.intersection(_FILE):
        raise RecordingError(f"the table {path} has no column {' or '.join(_FILE[:4])}")
    if not columns.intersection(_LABEL + ANGLES):
        raise RecordingError(f"the table {path} has no column label or angle")
    rows: list[tuple[str, Cells]] = []
    while True:
        place = f"{path.name} line {reader.line_num + 1}"
        try:
            row = next(reader)
        except StopIteration:
            break
        except csv.Error as error:
            report.skip(place, f"cannot be read: {error}")
            continue
        if any(value is None for value in row.values()):
            report.skip(place, "the row is cut")
        else:
            rows.append((place, {(k or "").strip().lower(): v for k, v in row.items() if k}))
    if rows and not text.endswith(("\n", "\r")):
        report.skip(rows.pop()[0], "no line break follows, so the row may be cut")
    return rows


def _seconds(text: str | None) -> float | None:
    try:
        return float(text or "")
    except ValueError:
        return None


def _find(row: Cells, names: tuple[str, ...]) -> str | None:
    return next((row[name] for name in names if name in row), None)


def _meant(row: Cells, threshold: float, known: Mapping[str, Action]) -> Meant:
    """Return the label of a row; raises ValueError if it has none that can be believed."""
    text, angle, throttle = (_find(row, names) for names in (_LABEL, ANGLES, (*THROTTLES, "speed")))
    if text is not None and not text.strip():
        return None, None
    label = known.get((text or "").strip().lower())
    if label is not None:
        return label, read_point([angle, throttle]) if row.get("degrees") == "yes" else None
    if text is not None and not angle:
        raise ValueError(f"the label {text[:40]!r} is not a move")
    return read_meant([angle, throttle] if throttle else [angle], threshold)
