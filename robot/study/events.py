"""A session's event log: an append-only CSV file with one line per event. Pure.

The log determines everything about a session: its state, its rows and the report. The events are
described in docs/reference/study.md.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields

from robot.errors import RecordingError, told_as
from robot.types import Action

EVENTS = (
    *("session_begun", "consent", "world", "condition_begun", "condition_resumed", "left"),
    *("recording", "mode", "frame", "intervention", "measure", "phase_ended"),
    *("answer", "answered", "session_ended"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEvent:
    """One line of the log. `position` and `attempt` count from 1; before the first condition they
    are 0."""

    wall_s: float
    event: str
    position: int = 0
    condition: str = ""
    attempt: int = 0
    phase: str = ""
    phase_s: float | None = None
    move: str = ""
    driven_by: str = ""
    distance_m: float | None = None
    name: str = ""
    value: str = ""


COLUMNS = tuple(field.name for field in fields(StudyEvent))
_WHOLE, _REAL = ("position", "attempt"), ("wall_s", "phase_s", "distance_m")
_LATEST_S = 2.5e11  # in the year 9892; Python's dates end in 9999
_RECORDING = re.compile(rb"(?m)^[^,\n]*,recording,.*,(\d{4}-\d\d-\d\d_\d{6}_\d{3})\r?$")
# A spreadsheet may run a cell as a formula if the cell begins with one of these characters. Line
# ends, tabs and semicolons can begin a new cell.
_CELL, _RUNS = r"(^|[;\t\r\n])", r"""((?:[^\S\t\r\n]|['"])*[=+\-@＝＋－＠])"""
_FORMULA, _DISARMED = re.compile(_CELL + _RUNS), re.compile(f"{_CELL}'{_RUNS}")


def write_csv(lines: Iterable[Sequence[object]]) -> str:
    """Return lines as CSV.

    Text that a spreadsheet would run as a formula gets an apostrophe in front.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for line in lines:
        writer.writerow(
            _FORMULA.sub(r"\1'\2", cell) if isinstance(cell, str) else "" if cell is None else cell
            for cell in line
        )
    return text.getvalue()


def write_events(events: Iterable[StudyEvent], *, with_head: bool = False) -> str:
    lines = [[getattr(event, column) for column in COLUMNS] for event in events]
    return write_csv([COLUMNS, *lines] if with_head else lines)


def whole_lines(data: bytes) -> bytes:
    """Return a log without its last line if a power cut has truncated this line."""
    return data[: data.rfind(b"\n") + 1]


def recordings_in(log: bytes) -> list[str]:
    """Return the names of the recordings that occur in a session's log, even if lines of the log
    are damaged."""
    found = _RECORDING.findall(log)
    return list(dict.fromkeys(name.decode() for name in found))


def read_events(data: bytes, where: str = "the event log") -> list[StudyEvent]:
    """Read a session's log; a truncated last line is left out. Raises RecordingError, with the line
    number, if `data` is not such a log, or if the log's beginning is missing."""
    with told_as(RecordingError, f"{where} is not UTF-8", UnicodeDecodeError):
        text = whole_lines(data).decode("utf-8-sig")
    events: list[StudyEvent] = []
    lines = csv.reader(io.StringIO(text))
    try:
        if tuple(next(lines, ())) != COLUMNS:
            raise ValueError(f"the header must be {','.join(COLUMNS)}")
        events.extend(map(_read, lines))
    except (ValueError, csv.Error) as error:
        raise RecordingError(f"{where}, line {lines.line_num}: {error}") from error
    return events


def check_begun(events: Sequence[StudyEvent], where: str) -> int:
    """Return the participant's number in the study (the slot), which the first event contains.
    Raises RecordingError if the first event is not `session_begun`."""
    first = events[0] if events else None
    if (
        first is None
        or first.event != "session_begun"
        or not re.fullmatch("[0-9]{1,6}", first.value)
    ):
        raise RecordingError(f"the first event of {where} is not session_begun")
    return int(first.value)


def _read(line: list[str]) -> StudyEvent:
    texts: dict[str, str] = dict(zip(COLUMNS, line, strict=True))
    if texts["event"] not in EVENTS:
        raise ValueError(f"unknown event {texts['event']!r}")
    values: dict[str, object] = {n: _DISARMED.sub(r"\1\2", text) for n, text in texts.items()}
    values.update({name: int(texts[name]) for name in _WHOLE})
    values.update({name: number_in(texts[name]) for name in _REAL})
    wall_s = number_in(texts["wall_s"])
    if wall_s is None or wall_s < 0:
        raise ValueError("'wall_s' is missing or negative")
    if texts["event"] == "frame":
        Action(texts["move"])  # raises if the name is invalid
    return StudyEvent(**values)  # type: ignore[arg-type]  # as the columns say


def number_in(text: str) -> float | None:
    """Return the number in a text, None if it is empty; raises ValueError if it is out of range."""
    number = float(text) if text else None
    if number is not None and not (math.isfinite(number) and abs(number) <= _LATEST_S):
        raise ValueError(f"{text!r} is out of range")
    return number
