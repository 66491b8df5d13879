"""Reads a folder of pictures with a table of their labels, which many programs can write."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from robot.errors import RecordingError, told_as
from robot.exchange.columns import (
    Cells,
    ColumnTable,
    UnclearColumnsError,
    read_table_file,
    unit_in,
)
from robot.exchange.drive import Drive, FrameEvent, ImportReport, drive_of
from robot.exchange.files import Pictures, read_head, read_picture_file, read_text
from robot.exchange.folder import MOVES
from robot.exchange.reading import Reading
from robot.exchange.stamps import seconds_in_name, seconds_of, unit_of
from robot.exchange.steering import (
    FULL_MPS,
    FULL_TURN_RAD_S,
    LabelAndPoint,
    at_velocity,
    at_wheels,
    check_unit,
    read_meant,
    read_number,
    read_point,
)
from robot.moves import CLASSIC, Move, names
from robot.recordings.moves import from_text
from robot.store.folder import fold
from robot.types import Action

ANY_TEXT = (".txt", ".json")
"""Suffixes of lists with lines such as `1.jpg 0.5`, and of JSON. Other text files have the same
suffixes, so a file is read only if it contains names of pictures."""
ENDINGS = (".csv", ".tsv", ".jsonl", *ANY_TEXT)

_FULL_SPEEDS = (1.0, 100.0, 255.0, 1023.0, 32767.0)
"""Values at which different programs drive a motor at full speed. For example, if the largest value
in a table is 200, full speed is assumed to be 255."""
_MOVES = 0.05
"""Speed, in any unit, above which a car counts as moving. Simulators write small speeds for
standing cars."""
_TOLD_NAMES = 3
_SPEEDS = {
    "mm/s": 1e-3,
    "cm/s": 1e-2,
    "km/h": 1 / 3.6,
    "mph": 0.44704,
    **dict.fromkeys(("deg/s", "degrees/s", "deg/sec", "\u00b0/s"), math.pi / 180),
}
"""Maps a unit of velocity, in brackets in a column's name, to its value in m/s or rad/s."""
_ANGLES = ("deg", "degrees", "\u00b0", "rad", "radians", "%", "percent")
"""Units that show that a column's steering does not go from -1 to 1."""
_NAMES_OF_UNITS = {1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}


def read_table(path: Path, reading: Reading, report: ImportReport) -> Drive:
    """Read a table with one row per picture; the pictures are in the table's folder, or below.

    Unusable rows are skipped. Raises RecordingError if all rows are unusable, or if the columns of
    the pictures or labels are ambiguous.
    """
    table = read_table_file(read_text(path), path.name, reading, report)
    moves, declared = path.with_name(MOVES), tuple[Move, ...]()
    if moves.is_file():
        with told_as(RecordingError, f"{moves} cannot be read", ValueError):
            declared = from_text(read_text(moves))
    known = {str(move): move for move in (*CLASSIC, *names(declared))}
    pictures = Pictures(path.parent)
    meant = _meaning(table, reading, known, report)
    unit = _unit_of_times(table, report)

    def read(place: str, cells: Cells) -> FrameEvent:
        is_others = (table.cell(cells, "mode") or "user").lower() != "user"
        name = table.cell(cells, "picture")
        if not name:
            raise ValueError("the row names no picture")
        label, point = (None, None) if is_others else meant(cells)
        return FrameEvent(
            place=place,
            t_s=_time(table, cells, name, unit),
            label=label,
            point=point,
            steering=None if _is_named(table, reading, known, cells) else _written(table, cells),
            picture=partial(read_picture_file, path.parent, pictures.find(name)),
            is_intervention=table.cell(cells, "correction") == "yes",
            is_others=is_others,
        )

    _report_other_pictures(table, pictures, report)
    return drive_of(
        table.rows,
        read,
        f"the table {path} has no rows",
        name=path.parent.name,
        source="folder",
        declared_moves=declared,
        report=report,
    )


def names_pictures(path: Path) -> bool:
    """Return whether the table at this path has a column of picture names. Only the first lines
    are read, unless the file is JSON."""
    try:
        if path.suffix.lower() == ".json":
            head = read_text(path)
        else:
            head = "\n".join([*read_head(path).splitlines()[:50], ""])
        table = read_table_file(head, path.name, Reading(), ImportReport())
    except RecordingError as error:
        return isinstance(error.__cause__, UnclearColumnsError)
    return bool(table.pictures)


def _unit_of_times(table: ColumnTable, report: ImportReport) -> float | None:
    """Return the unit of the times, in seconds; None if `seconds_of` reads them correctly. Report
    a unit that was inferred from the times."""
    if "time" not in table.columns:
        return None
    written = (table.number(cells, "time") for _, cells in table.rows)
    unit = unit_of(written, table.name("time"))
    if unit is not None:
        report.remark(f"the times in {table.name('time')!r} are read as {_NAMES_OF_UNITS[unit]}")
    return unit


def _time(table: ColumnTable, cells: Cells, picture: str, unit: float | None) -> float | None:
    text = table.cell(cells, "time")
    if text is None:
        return seconds_in_name(picture)
    written = table.number(cells, "time")
    if unit is not None:
        with contextlib.suppress(ValueError):
            return float(written) * unit
    at_s = seconds_of(written, table.names[table.columns["time"]])
    return seconds_of(text) if at_s is None else at_s


def _written(table: ColumnTable, cells: Cells) -> float | None:
    try:
        return float(table.number(cells, "steering"))
    except ValueError:
        return None


def _meaning(
    table: ColumnTable, reading: Reading, known: Mapping[str, Action], report: ImportReport
) -> Callable[[Cells], LabelAndPoint]:
    """Return a function that computes a row's label from the columns that are present."""
    there = table.columns
    if "label" in there:
        return partial(_labelled, table, reading, known)
    if "steering" in there:
        written = (table.number(cells, "steering") for _, cells in table.rows)
        check_unit(written, table.name("steering"), reading)
        unit = unit_in(table.name("steering"))
        if reading.full_lock == 1.0 and unit in _ANGLES:
            raise RecordingError(
                f"the steering in {table.name('steering')!r} is given in {unit}, not from -1 to 1; "
                "give the value of full lock with --full-lock"
            )
        return partial(_steered, table, reading)
    number = partial(_number, table)
    if "left_wheel" in there:
        sides = "left_wheel", "right_wheel"
        most = max((_most(table, role) for role in sides), default=0.0)
        full = next((full for full in _FULL_SPEEDS if most <= full), most)
        report.remark(f"full speed of a wheel is assumed to be {full:g}")
        return lambda cells: at_wheels(
            number(cells, sides[0]) / full, number(cells, sides[1]) / full, reading
        )
    full_mps = FULL_MPS / _SPEEDS.get(unit_in(table.name("linear")), 1.0)
    full_turn = FULL_TURN_RAD_S / _SPEEDS.get(unit_in(table.name("angular")), 1.0)
    return lambda cells: at_velocity(
        number(cells, "linear") / full_mps, number(cells, "angular") / full_turn, reading
    )


def _labelled(
    table: ColumnTable, reading: Reading, known: Mapping[str, Action], cells: Cells
) -> LabelAndPoint:
    """Return the label of a row; raises ValueError if it is missing or invalid."""
    text = table.cell(cells, "label") or ""
    if not text:
        return None, None
    label = _move_named(text, reading, known)
    if label is Action.STOP:
        return None, None
    if label is None and "steering" in table.columns and table.cell(cells, "steering"):
        return _steered(table, reading, cells)
    if label is None:
        raise ValueError(
            f"the label {text[:40]!r} is not a move; assign it to a move with --moves, "
            f"for example --moves {_quoted(f'{text[:40]}=left')}"
        )
    if table.cell(cells, "degrees") != "yes":
        return label, None
    return label, read_point([table.number(cells, role) for role in ("steering", "throttle")])


def _is_named(
    table: ColumnTable, reading: Reading, known: Mapping[str, Action], cells: Cells
) -> bool:
    """True if a row's label comes from the label column, and not from the steering."""
    text = table.cell(cells, "label")
    return text is not None and (not text or _move_named(text, reading, known) is not None)


def _move_named(text: str, reading: Reading, known: Mapping[str, Action]) -> Action | None:
    return known.get(text.lower()) or reading.move(text)


def _quoted(text: str) -> str:
    return f'"{text}"' if " " in text else text


def _steered(table: ColumnTable, reading: Reading, cells: Cells) -> LabelAndPoint:
    """Return the label of a row from its steering.

    If the table has a column of speeds, a car that rolls without throttle counts as driving.
    """
    angle, throttle = (table.number(cells, role) for role in ("steering", "throttle"))
    named = "the angle", "the throttle"
    if "speed" in table.columns and table.cell(cells, "speed"):
        is_pushed = bool(throttle) and read_number(throttle, "the throttle") > 0
        if not is_pushed:
            label, _ = read_meant([angle], reading, named)
            is_moving = read_number(table.number(cells, "speed"), "the speed") > _MOVES
            return label if is_moving else None, None
    return read_meant([angle, throttle] if throttle else [angle], reading, named)


def _number(table: ColumnTable, cells: Cells, role: str) -> float:
    return read_number(table.number(cells, role), table.name(role))


def _most(table: ColumnTable, role: str) -> float:
    """Return the largest absolute value of a column; cells that are not numbers count as 0."""
    most = 0.0
    for _, cells in table.rows:
        try:
            most = max(most, abs(_number(table, cells, role)))
        except ValueError:
            continue
    return most


def _report_other_pictures(table: ColumnTable, pictures: Pictures, report: ImportReport) -> None:
    """Report how many pictures the table does not list, or lists only for other cameras."""
    others = [i for i in table.pictures if i != table.columns["picture"]]
    if others:
        told = ", ".join(table.names[i] or f"column {i + 1}" for i in others[:_TOLD_NAMES])
        report.remark(f"left out, as pictures of other cameras: {told}")
    last = {
        fold(cells[i].replace("\\", "/").rpartition("/")[2].strip())
        for _, cells in table.rows
        for i in {*table.pictures, table.columns["picture"]}
    }
    missing = [path for path in pictures.all() if fold(path.rpartition("/")[2]) not in last]
    if missing:
        report.remark(f"left out: {len(missing)} pictures that the table does not list")
