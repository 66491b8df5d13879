"""Finds the meanings of a table's columns by the columns' names, or else by their content."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from robot.errors import RecordingError, did_you_mean, told_as
from robot.exchange.drive import ImportReport
from robot.exchange.files import PICTURES, parse
from robot.exchange.reading import Reading
from robot.exchange.stamps import seconds_of
from robot.types import Action

Cells = list[str]
Row = tuple[str, Cells]
"""A row of a table: its location, for the import's report, and its cells."""

NAMES: dict[str, tuple[str, ...]] = {
    "picture": (
        *("file", "image", "filename", "file_name", "path", "img", "image_path", "image_file"),
        *("img_path", "image_name", "picture", "photo", "cam/image_array"),
        *("center", "centre", "center_image", "frame_path"),
    ),
    "label": (
        "label",
        "move",
        "action",
        "class",
        "direction",
        "drivelesson/label",
        "text",
        "choice",
    ),
    "steering": ("angle", "steering", "user/angle", "steering_angle", "steer", "steering_pos"),
    "throttle": ("throttle", "user/throttle", "throttle_vel", "gas"),
    "speed": ("speed", "velocity"),
    "left_wheel": (
        *("left_wheel", "left_ctrl", "leftctrl", "left_motor", "left_speed", "wheel_left"),
        *("motor_left", "left"),
    ),
    "right_wheel": (
        *("right_wheel", "right_ctrl", "rightctrl", "right_motor", "right_speed", "wheel_right"),
        *("motor_right", "right"),
    ),
    "linear": ("linear_velocity", "linear_x", "field_linear_x", "twist_linear_x", "linear_vel"),
    "angular": (
        *("angular_velocity", "angular_z", "field_angular_z", "twist_angular_z", "angular_vel"),
    ),
    "time": (
        *("time_s", "t", "time", "timestamp", "seconds", "time_ms", "timestamp_ms", "ms"),
        *("milliseconds", "timestamp_ns", "time_ns", "datetime", "date", "stamp", "_timestamp_ms"),
    ),
    "mode": ("user/mode", "mode"),
    "correction": ("correction",),
    "degrees": ("degrees",),
}
"""The names that a column may have, by the column's meaning."""
_MEANT = "label", "steering", "left_wheel", "linear"
"""A label can be computed if a table has a column with one of these meanings. If a table has
columns for several of these meanings, the first meaning in this list counts."""
_PAIRS = ("left_wheel", "right_wheel"), ("linear", "angular")
_SIDES = re.compile(r"(?:^|[\W_])(left|right)(?:$|[\W_])", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[-+]?(?![1-9]\d{0,2},\d{3}$)\d*,\d+")
"""A number with a decimal comma: `0,5`, but not `1,500`, whose comma may separate thousands."""
_STATED = re.compile(r"\s*sep=(.)\n", re.IGNORECASE)
"""The line `sep=;` with which Excel declares the delimiter of a table."""
_COMMENTS = re.compile(r"\s*(?:#[^,;\t|\n]*\n\s*)+")
"""Comment lines above a table."""
_PEEK_ROWS = 50
_FLAGS = {"": "", "0": "0", "1": "1", "0.0": "0", "1.0": "1", "false": "0", "true": "1"}
"""Maps each possible cell of a move's own column to 1 (this move), 0 (another move) or nothing."""
_UDACITY = "steering", "throttle", "brake", "speed"


class UnclearColumnsError(ValueError):
    """Several columns may have the same meaning, so a person must choose one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnTable:
    """The content of a table: its rows, and its columns by their meanings."""

    rows: list[Row]
    columns: Mapping[str, int]
    names: Sequence[str]
    has_decimal_commas: bool = False
    pictures: tuple[int, ...] = ()
    """All columns that contain picture names, including the columns of unused cameras."""

    def cell(self, cells: Cells, role: str) -> str | None:
        """Return the cell of a row in the column with this meaning; None if there is no such
        column."""
        return cells[self.columns[role]].strip() if role in self.columns else None

    def number(self, cells: Cells, role: str) -> str:
        """Return a number's text with a decimal point instead of a comma, and with a plain minus
        sign."""
        text = (self.cell(cells, role) or "").replace("\u2212", "-")
        has_comma = self.has_decimal_commas or _DECIMAL_COMMA.fullmatch(text)
        return text.replace(",", ".") if has_comma else text

    def name(self, role: str) -> str:
        """Return the name of the column with this meaning."""
        return self.names[self.columns[role]] or role


def read_table_file(text: str, name: str, reading: Reading, report: ImportReport) -> ColumnTable:
    """Read the complete rows, and find the columns' meanings.

    `reading.columns` contains the columns that the user chose. Raises RecordingError if there is no
    column of pictures or of labels, or if it is unclear which column is meant.
    """
    is_json = name.lower().endswith((".json", ".jsonl"))
    if name.lower().endswith(".json"):
        text = _as_lines(text)
    if above := _COMMENTS.match(text) or _STATED.match(text):
        # the empty lines preserve the line numbers
        text = "\n" * above[0].count("\n") + text[above.end() :]
    head_line = next((line for line in text.splitlines() if line.strip()), "")
    is_list = name.lower().endswith(".txt")
    delimiter = max(",; " if is_list else ",;\t|", key=head_line.count)
    delimiter = above[1] if above and above.re is _STATED else delimiter
    if is_list:  # several spaces may separate two cells of a list, as in `1.jpg  0.5`
        text = re.sub(r"[ \t,]+" if delimiter != ";" else r"[ \t]*;[ \t]*", ";", text)
        delimiter = ";"
    read = _json_lines(text, name, report) if is_json else _lines(text, name, delimiter, report)
    rows: list[Row] = []
    header: Cells | None = None
    width = 0
    for place, cells in read:
        if not width:
            width = len(cells)
            if is_json or not any(map(is_picture_name, cells)):
                header = cells
                continue
        if len(cells) < width:
            report.skip(place, "the row is incomplete")
        else:
            rows.append((place, cells))
    if rows and not text.endswith(("\n", "\r")) and not is_json:
        report.skip(rows.pop()[0], "the last line does not end, so it may be incomplete")
    with told_as(RecordingError, f"the table {name} cannot be used", ValueError):
        if header is not None and not reading.columns.keys() & {*_MEANT}:
            header, rows = _with_labels(header, rows, reading)
            width = len(header)
        names, columns = _meanings(header, [cells for _, cells in rows], width, reading.columns)
    sample = [cells for _, cells in rows[:_PEEK_ROWS]]
    return ColumnTable(
        rows=rows,
        columns=columns,
        names=names,
        has_decimal_commas=delimiter != "," and not is_json,
        pictures=tuple(_of_pictures(sample, width)),
    )


def _lines(text: str, name: str, delimiter: str, report: ImportReport) -> Iterator[Row]:
    """Yield the rows that are not empty, with their locations."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    while True:
        place = f"{name} line {reader.line_num + 1}"
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            report.skip(place, f"cannot be read: {error}")
            continue
        if any(cell.strip() for cell in cells):
            yield place, cells


def _json_lines(text: str, name: str, report: ImportReport) -> Iterator[Row]:
    """Yield the rows of a table in the format JSON Lines. The first row has the names of all
    fields; each JSON object is one more row."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        row = parse(line)
        if isinstance(row, dict):
            found.append((f"{name} line {number}", row))
        elif line.strip():
            report.skip(f"{name} line {number}", "it is not a JSON object")
    fields = list(dict.fromkeys(key for _, row in found for key in row))
    yield name, fields
    for place, row in found:
        yield place, ["" if row.get(field) is None else str(row[field]) for field in fields]


def _as_lines(text: str) -> str:
    """Convert a JSON file to JSON Lines. The file contains a list of objects, or one object that
    maps each picture to its label, its steering or an object. Any other file has no rows."""
    found = parse(text)
    if isinstance(found, dict):
        found = [{"file": key, **_named(of)} for key, of in found.items() if is_picture_name(key)]
    return "\n".join(map(json.dumps, found)) if isinstance(found, list) else ""


def _named(of: object) -> dict[str, object]:
    """Return a picture's values by column. A string is its label, and a number is its steering."""
    if isinstance(of, dict):
        return of
    return {"label": of} if isinstance(of, str) else {"steering": of}


def is_picture_name(text: str) -> bool:
    """True if the text ends with the suffix of a picture file."""
    return text.strip().lower().endswith((*PICTURES, ".webp", ".bmp", ".gif"))


def plain(name: str) -> str:
    """Return a column's name in lower case, with `_` between words and without a unit."""
    text = re.sub(r"[\[(].*?[\])]", "", name.strip().strip("\"'#").lower())
    return re.sub(r"[\s.\-]+", "_", text.strip()).strip("_") or name.strip().lower()


def unit_in(name: str) -> str:
    """Return the unit in brackets in a column's name, or an empty string."""
    found = re.search(r"[\[(](.*?)[\])]", name.lower())
    return found[1].replace(" ", "") if found else ""


def _meanings(
    header: Cells | None, rows: list[Cells], width: int, said: Mapping[str, str]
) -> tuple[list[str], dict[str, int]]:
    names = [plain(name) for name in header or [""] * width]
    columns = {role: _chosen_column(role, which, names) for role, which in said.items()}
    sample = rows[:_PEEK_ROWS]
    of_pictures = _of_pictures(sample, width)
    free = set(range(width)) - set(columns.values())
    if header is None:
        _by_content(columns, sample, of_pictures, free)
        _check(columns, ["" for _ in names], of_pictures)
        return [f"column {n + 1}" for n in range(width)], columns
    for role, known in NAMES.items():
        if role in columns:
            continue
        found = [i for i in sorted(free) if names[i] in known]
        if role == "picture":
            found = _picture_columns(found, of_pictures, names)
        elif role.endswith("_wheel"):
            found = [i for i in found if i not in of_pictures]
        if len(found) > 1 and role != "time" and not _are_equal(found, rows):
            told = " and ".join(repr(header[i].strip()) for i in found)
            raise UnclearColumnsError(
                f"cannot tell which of {told} is the {role}: choose one with --columns {role}=NAME"
            )
        if found:
            columns[role] = min(found, key=lambda i: known.index(names[i]) if role == "time" else i)
    for pair in _PAIRS:
        if len(columns.keys() & set(pair)) == 1:
            columns.pop(next(iter(columns.keys() & set(pair))))
    _check(columns, names, of_pictures)
    return [name.strip() for name in header], columns


def _with_labels(header: Cells, rows: list[Row], reading: Reading) -> tuple[Cells, list[Row]]:
    """Some tables, such as Roboflow's, have one column per move: 1 for the picture's move, and 0
    for the others. Add a column with the name of this move."""
    moves = {i: reading.move(plain(name)) for i, name in enumerate(header)}
    there = [i for i, move in moves.items() if move is not None]
    cells = [[_FLAGS.get(row[i].strip().lower()) for i in there] for _, row in rows]
    if len(there) < 2 or any(cell is None for row in cells for cell in row):
        return header, rows
    if {moves[i] for i in there} <= {Action.LEFT, Action.RIGHT}:
        if any(not row.count("0") and "" not in row for row in cells):
            # a robot cannot turn left and right at once, so these are the speeds of two wheels
            return header, rows
        told = " and ".join(repr(header[i].strip()) for i in there)
        raise UnclearColumnsError(
            f"the columns {told} may be moves or the speeds of two wheels; for wheels, rename them "
            "to left_wheel and right_wheel; for moves, replace them with one column named label"
        )
    labels = [
        " and ".join(header[i].strip() for i, cell in zip(there, row, strict=True) if cell == "1")
        for row in cells
    ]
    labelled = [(place, [*row, label]) for (place, row), label in zip(rows, labels, strict=True)]
    return [*header, "label"], labelled


def _chosen_column(role: str, which: str, names: list[str]) -> int:
    if which.isdecimal() and 1 <= int(which) <= len(names):
        return int(which) - 1
    if plain(which) in names:
        return names.index(plain(which))
    known = [name for name in names if name]
    hint = did_you_mean(plain(which), known)
    raise ValueError(f"there is no column {which!r} for {role}{hint}; numbers: 1 to {len(names)}")


def _of_pictures(sample: list[Cells], width: int) -> list[int]:
    """Return the columns in which most cells are names of pictures."""
    of: list[int] = []
    for column in range(width):
        filled = [row[column] for row in sample if row[column].strip()]
        if 2 * sum(map(is_picture_name, filled)) > len(filled):
            of.append(column)
    return of


def _picture_columns(named: list[int], of_pictures: list[int], names: list[str]) -> list[int]:
    """Choose the columns that may contain the main camera's pictures: those whose names suggest
    pictures, or else all that contain picture names. A side camera is chosen only if there is no
    other camera."""
    chosen = [i for i in named if i in of_pictures] or named or of_pictures
    ahead = [i for i in chosen if not _SIDES.search(names[i])]
    return ahead or chosen


def _are_equal(found: list[int], rows: list[Cells]) -> bool:
    return bool(rows) and all(len({row[i].strip() for i in found}) == 1 for row in rows)


def _by_content(
    columns: dict[str, int], sample: list[Cells], of_pictures: list[int], free: set[int]
) -> None:
    """Find the meanings of the columns of a table without a header line, if the meanings are
    unambiguous."""
    if "picture" not in columns and of_pictures:
        ahead = [i for i in of_pictures if not all(_SIDES.search(row[i]) for row in sample)]
        if len(ahead or of_pictures) > 1:
            raise UnclearColumnsError(
                f"{len(of_pictures)} columns contain picture names: "
                "choose one with --columns picture=NUMBER"
            )
        columns["picture"] = (ahead or of_pictures)[0]
    free -= {*of_pictures, *columns.values()}
    numeric = [i for i in sorted(free) if all(_is_number(row[i]) for row in sample)]
    texts = sorted(free.difference(numeric))
    if len(of_pictures) == 3 and len(numeric) == 4 and "steering" not in columns:
        columns |= {role: i for role, i in zip(_UDACITY, numeric, strict=True) if role in NAMES}
        return
    if "time" not in columns:
        times = [i for i in numeric if all(float(row[i] or 0) > 1e9 for row in sample)]
        dates = [i for i in texts if all(seconds_of(row[i]) is not None for row in sample)]
        if len(times + dates) == 1:
            columns["time"] = (times + dates)[0]
            numeric = [i for i in numeric if i not in times]
            texts = [i for i in texts if i not in dates]
    if columns.keys() & set(_MEANT):
        return
    if len(numeric) == 1 and not texts:
        [column] = numeric
        if all(row[column].strip().isdecimal() for row in sample):
            raise UnclearColumnsError(
                f"the table has no header, so column {column + 1} may be a class or the steering; "
                f"choose with --columns label={column + 1} or --columns steering={column + 1}"
            )
        columns["steering"] = column
    elif len(texts) == 1 and not numeric:
        columns["label"] = texts[0]
    elif numeric or texts:
        told = " or ".join(str(i + 1) for i in sorted((*numeric, *texts)))
        raise UnclearColumnsError(
            f"the table has no header, so the steering may be in column {told}; choose one with "
            "--columns steering=NUMBER"
        )


def _is_number(text: str) -> bool:
    try:
        float(text.strip().replace(",", "."))
    except ValueError:
        return False
    return True


def _check(columns: Mapping[str, int], names: list[str], of_pictures: list[int]) -> None:
    if "picture" not in columns:
        raise ValueError(f"there is no column of pictures ({', '.join(NAMES['picture'][:4])})")
    if not columns.keys() & set(_MEANT):
        there = [name for name in names if name]
        told = f"; its columns: {', '.join(there)[:200]}" if there else ""
        raise ValueError(
            f"there is no column for a label, steering, two wheels or velocities{told}; choose one "
            "with --columns label=NAME or --columns steering=NAME"
        )
