"""A session's event log: one CSV file, one line an event, only ever appended to. Pure.

Everything about a session is derived from its log: where it stands, its rows, the report. What
each event means is in docs/reference/study.md.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass

from robot.errors import RecordingError

COLUMNS = (
    *("wall_s", "event", "position", "condition", "attempt", "phase", "phase_s"),
    *("move", "driven_by", "distance_m", "name", "value"),
)
EVENTS = (
    *("session_begun", "consent", "world", "condition_begun", "condition_resumed", "left"),
    *("recording", "mode", "frame", "intervention", "measure", "phase_ended"),
    *("answer", "answered", "session_ended"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyEvent:
    """One line of the log. `position` and `attempt` count from 1; 0 is before any condition."""

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


def write_events(events: Iterable[StudyEvent], *, with_head: bool = False) -> str:
    """Return events as lines of CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    if with_head:
        writer.writerow(COLUMNS)
    for event in events:
        values = (getattr(event, column) for column in COLUMNS)
        writer.writerow("" if value is None else value for value in values)
    return text.getvalue()


def whole_lines(data: bytes) -> bytes:
    """Return a log without the line that a power cut left half written."""
    return data[: data.rfind(b"\n") + 1]


def read_events(data: bytes, where: str = "the event log") -> list[StudyEvent]:
    """Read a log; a last line that was cut short is left out.

    Raises:
        RecordingError: If it is not such a log; says which line.
    """
    try:
        text = whole_lines(data).decode()
    except UnicodeDecodeError as error:
        raise RecordingError(f"{where} is not UTF-8: {error}") from error
    lines = csv.reader(io.StringIO(text))
    if tuple(next(lines, ())) != COLUMNS:
        raise RecordingError(f"{where}: the first line must be {','.join(COLUMNS)}")
    events = []
    for number, line in enumerate(lines, start=2):
        try:
            events.append(_read(line))
        except ValueError as error:
            raise RecordingError(f"{where}, line {number}: {error}") from error
    return events


def _read(line: list[str]) -> StudyEvent:
    fields = dict(zip(COLUMNS, line, strict=True))
    if fields["event"] not in EVENTS:
        raise ValueError(f"there is no event {fields['event']!r}")
    return StudyEvent(
        wall_s=float(fields["wall_s"]),
        event=fields["event"],
        position=int(fields["position"]),
        condition=fields["condition"],
        attempt=int(fields["attempt"]),
        phase=fields["phase"],
        phase_s=_number(fields["phase_s"]),
        move=fields["move"],
        driven_by=fields["driven_by"],
        distance_m=_number(fields["distance_m"]),
        name=fields["name"],
        value=fields["value"],
    )


def _number(text: str) -> float | None:
    return float(text) if text else None
