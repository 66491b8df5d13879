"""The rows of another program's drive, as far as they are whole: the one way into an episode.

A reader says of each row where it stands and what it means. Here what cannot be used is skipped and
listed, times become a time line, and pictures are read one at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from robot.devices.pictures import Picture
from robot.errors import RecordingError
from robot.exchange.drive import Drive, Shot, moves_with
from robot.exchange.report import ImportReport
from robot.exchange.timeline import make_timeline
from robot.types import Action, Point

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One picture of a drive, before it is read."""

    place: str
    """Where it stands, for the report."""
    stamp_s: object
    """Seconds of any clock; anything else counts as missing."""
    label: Action | None
    point: Point | None = None
    """The label by degrees, if it was meant so."""
    picture: Callable[[], Picture]
    """Raises RecordingError if it is damaged."""
    is_intervention: bool = False
    is_others: bool = False
    """Not driven by the pilot, as far as is known: so no example."""


def whole_rows(
    found: Iterable[tuple[str, _T]], read: Callable[[str, _T], Row], report: ImportReport
) -> list[Row]:
    """Return the rows that can be read; `read` raises ValueError for one that cannot."""
    rows = []
    for place, raw in found:
        try:
            rows.append(read(place, raw))
        except ValueError as error:
            report.skip(place, str(error))
    return rows


def drive_of(rows: list[Row], what: str, *, report: ImportReport, **about: Any) -> Drive:
    """Make a drive of rows.

    Args:
        rows: At least one.
        what: What they were found in, for a person.
        report: What was skipped so far.
        **about: Further fields of the drive.

    Raises:
        RecordingError: If there are none.
    """
    if not rows:
        raise RecordingError(f"{what} to use{report.why_nothing()}")
    others = sum(row.is_others for row in rows)
    report.remark(f"not driven by the pilot, so no examples: {others} pictures" if others else None)
    line = make_timeline([row.stamp_s for row in rows])
    report.remark(line.remark)
    moves = moves_with(row.label for row in rows)
    return Drive(
        **{"moves": moves, **about}, shots=_shots(rows, line.times_s, report), report=report
    )


def _shots(rows: list[Row], times_s: list[float], report: ImportReport) -> Iterator[Shot]:
    for row, t_s in zip(rows, times_s, strict=True):
        try:
            picture = row.picture()
        except RecordingError as error:
            report.skip(row.place, str(error))
            continue
        yield Shot(
            t_s=t_s,
            picture=picture,
            label=row.label,
            point=row.point,
            is_intervention=row.is_intervention,
        )
