"""A drive from another program, and its conversion to an episode. Every import uses this module.

A reader supplies the location and the label of each picture. This module skips and lists unusable
pictures, makes a time line of the pictures' times, and reads the pictures one at a time.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from statistics import median, mode
from typing import Any, TypeVar

import numpy as np

from robot.clock import RealClock
from robot.devkit.pictures import Picture
from robot.errors import RecordingError
from robot.exchange.stamps import date_or_zero
from robot.exchange.timeline import make_timeline, order_if_shuffled
from robot.moves import CLASSIC, Move, point_of
from robot.policy.events import Taught
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.store.folder import whole_file
from robot.types import DEFAULT_MOVES, Action, Example, Frame, Point

_T = TypeVar("_T")
_MOST_PLACES, _MOST_REASONS = 3, 12
"""Maximum number of locations that a report lists for one reason, and maximum number of reasons
that it lists. The report only counts all others."""
_ENOUGH_TO_HINT = 10
"""If a drive has turns to only one side, and at least this number of examples with steering, its
report contains a hint."""
_LEAST_TRIM = 0.01
_2026_S, _2100_S = 1_767_225_600.0, 4_102_444_800.0
"""The beginnings of these years, in seconds since 1970."""


class ImportReport:
    """Collects the items that an import skips while it reads a drive. If the report is strict, the
    first skipped item raises an error."""

    def __init__(self, *, is_strict: bool = False) -> None:
        self.is_strict = is_strict
        self.skipped: list[tuple[str, str]] = []
        """Location and reason of each skipped item."""
        self.remarks: list[str] = []
        self.labels: Counter[Action] = Counter()
        """Number of written examples by label."""
        self.rate: float = 0.0
        """The usual number of pictures per second in the drive."""

    def skip(self, place: str, reason: str) -> None:
        """Record a skipped item; raises RecordingError if the import is strict."""
        place, reason = map(_shown, (place, reason))
        if self.is_strict:
            raise RecordingError(f"{place}: {reason}")
        self.skipped.append((place, reason))

    def remark(self, text: str | None) -> None:
        """Add a remark about the drive to the report, unless the remark is None."""
        if text and text not in self.remarks:
            self.remarks.append(text)

    def lines(self) -> list[str]:
        """Return the report as lines of text: the remarks, the number of skipped items, and a line
        for each reason for skipping."""
        places: dict[str, list[str]] = {}
        for place, reason in self.skipped:
            places.setdefault(reason, []).append(place)
        by_count = sorted(places.items(), key=lambda found: -len(found[1]))
        told = [f"skipped: {len(self.skipped)}"] if self.skipped else []
        told += [f"  {reason}: {_counted(found)}" for reason, found in by_count[:_MOST_REASONS]]
        if rest := [found for _, found in by_count[_MOST_REASONS:]]:
            told.append(f"  for {len(rest)} other reasons: {sum(map(len, rest))}")
        return self.remarks + told

    def why_nothing(self) -> str:
        """Return a clause for an error about an empty drive: the number of skipped items, and the
        reason for the first. The clause is empty if nothing was skipped."""
        if not self.skipped:
            return ""
        place, reason = self.skipped[0]
        return f"; {len(self.skipped)} were skipped, the first at {place}: {reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameEvent:
    """One picture of a drive, with its label if it has one."""

    picture: Callable[[], Picture]
    """Reads the picture; raises RecordingError if the picture is damaged."""
    t_s: object
    """Time in seconds, from any starting point. A value that is not a number counts as missing."""
    label: Action | None
    point: Point | None = None
    """The steering and throttle of the pilot, if the pilot steered proportionally."""
    does: Point | None = None
    """The steering and throttle of the labelled move on the robot that drove; None if they are
    unknown."""
    steering: float | None = None
    """The steering as written, in the source's unit, which is also the unit of `Reading.trim`; None
    if it is missing."""
    is_intervention: bool = False
    is_others: bool = False
    """True if somebody other than the pilot drove, so the picture is not an example."""
    place: str = ""
    """The picture's location, for the import's report."""

    def frame(self, frame_id: int, captured_s: float) -> Frame:
        """Read the picture as a camera's frame; raises RecordingError if it is damaged."""
        picture = self.picture()
        return Frame(
            frame_id=frame_id,
            captured_s=captured_s,
            width=picture.width,
            height=picture.height,
            encoding=picture.encoding,
            data=picture.data,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A drive: its name, its source and its pictures."""

    name: str
    source: str
    shots: Sequence[FrameEvent]
    moves: tuple[Action, ...] = DEFAULT_MOVES
    declared_moves: tuple[Move, ...] = ()
    started_at_s: float = 0.0
    """Start of the drive in seconds since 1970; 0 if unknown."""
    report: ImportReport = field(default_factory=ImportReport)


def drive_of(
    found: Iterable[tuple[str, _T]],
    read: Callable[[str, _T], FrameEvent],
    what: str,
    *,
    report: ImportReport,
    **about: Any,
) -> Drive:
    """Make a drive of the readable pictures. Raises RecordingError if no picture is readable.

    `read` converts a location and the item found there to a FrameEvent, or raises ValueError.
    `what` is the start of the error message, such as `the tub T has no records`. `about` contains
    values for the remaining fields of the drive.
    """
    shots = []
    for place, raw in found:
        try:
            shots.append(read(place, raw))
        except ValueError as error:
            report.skip(place, str(error))
    if not shots:
        raise RecordingError(f"{what} to use{report.why_nothing()}")
    if order := order_if_shuffled([shot.t_s for shot in shots]):
        shots = [shots[index] for index in order]
        report.remark("the pictures were not in the order of their times, and were sorted by time")
    if others := sum(shot.is_others for shot in shots):
        report.remark(f"left out, because the pilot did not drive: {others} pictures")
    stands = sum(shot.label is None and shot.steering is not None for shot in shots) - others
    if stands > 0:
        report.remark(f"left out, because the car stood or drove backward: {stands} pictures")
    moves = _moves_with(shot.label for shot in shots)
    known: dict[str, Any] = {"moves": moves, "declared_moves": _declared(shots)}
    known["started_at_s"] = date_or_zero(shots[0].t_s)
    return Drive(shots=shots, report=report, **{**known, **about})


def _latest_s(now_s: float) -> float:
    """Return the latest time at which a drive can have begun: now, unless this machine's clock is
    clearly wrong. For example, a Raspberry Pi without a network may start in 1970."""
    return now_s if now_s >= _2026_S else _2100_S


def write_episode(drive: Drive, path: Path, *, on_shot: Callable[[], None] = lambda: None) -> int:
    """Write a drive as an episode; return its number of pictures.

    Raises RecordingError if the drive is broken or empty, and OSError if the disk fails. After an
    error no file is left.
    """
    line = make_timeline([shot.t_s for shot in drive.shots])
    drive.report.remark(line.remark)
    drive.report.rate = 1 / line.usual_s
    taken = _frames(drive, line.times_s)
    first = next(taken, None)
    if first is None:
        raise RecordingError(f"{drive.name} has no pictures to use{drive.report.why_nothing()}")
    # If the drive's date is unknown, write 0, so that it is not taken for the most recent drive.
    started_at_s = date_or_zero(drive.started_at_s)
    if started_at_s > _latest_s(RealClock().wall_s()):
        started_at_s = 0.0
    run = describe_run(
        episode_id=path.stem,
        run_id=path.stem,
        origin_ns=round(started_at_s * 1e9),
        started_at_s=started_at_s,
        moves=tuple(move.value for move in drive.moves),
        declared_moves=drive.declared_moves,
        source=drive.source,
        pictures=first[1].encoding,
    )
    with whole_file(path) as file:
        writer = EpisodeWriter(file, run)
        for shot, frame in chain([first], taken):
            writer.write_frame(frame)
            _write_label(writer, shot, frame)
            if shot.label:
                drive.report.labels[shot.label] += 1
            on_shot()
        writer.close({"dropped_frames": "0", "lost_words": "0"})
    drive.report.remark(_hint(drive))
    return writer.frames


def _frames(drive: Drive, times_s: Iterable[float]) -> Iterator[tuple[FrameEvent, Frame]]:
    """Read the pictures one by one, with ids from 1; report the damaged ones."""
    frame_id = 1
    for shot, t_s in zip(drive.shots, times_s, strict=True):
        try:
            frame = shot.frame(frame_id, t_s)
        except RecordingError as error:
            drive.report.skip(shot.place, str(error))
        else:
            frame_id += 1
            yield shot, frame


def _hint(drive: Drive) -> str | None:
    """Return a hint for a drive with examples of turning to one side only. Return None if there are
    examples to both sides, or if there is too little steering to judge."""
    labels, written = drive.report.labels, [s.steering for s in drive.shots if s.label]
    steered = [s for s in written if isinstance(s, int | float) and math.isfinite(s)]
    missing = [side for side in (Action.LEFT, Action.RIGHT) if not labels[side]]
    if len(steered) < _ENOUGH_TO_HINT or len(missing) != 1:
        return None
    middle = median(steered)
    if abs(middle) == max(map(abs, steered)):
        return None  # the car mostly turned, so the median is not straight on
    trim = f"--trim {middle:.2f}" if abs(middle) >= _LEAST_TRIM else "a smaller --threshold"
    return (
        f"no example of {missing[0]}: steering lies between {min(steered):.2f} and "
        f"{max(steered):.2f}, with a median of {middle:.2f}; if the car drives straight at the "
        f"median, import again with {trim}"
    )


def _write_label(writer: EpisodeWriter, shot: FrameEvent, frame: Frame) -> None:
    if shot.label is None:
        return
    example = Example(
        frame_id=frame.frame_id,
        label=shot.label,
        is_intervention=shot.is_intervention,
        point=shot.point,
    )
    at_s = frame.captured_s
    writer.write_lesson(at_s, Taught(example=example, x=np.zeros(0), at_s=at_s))


def _moves_with(labels: Iterable[Action | None]) -> tuple[Action, ...]:
    """Return the moves among the labels. All three usual moves are included if one of them is among
    the labels, or if there are no labels.
    """
    found = dict.fromkeys(label for label in labels if label is not None)
    if not found or not found.keys().isdisjoint(DEFAULT_MOVES):
        found |= dict.fromkeys(DEFAULT_MOVES)
    return (*(m for m in CLASSIC if m in found), *(m for m in found if m not in CLASSIC))


def _declared(shots: Iterable[FrameEvent]) -> tuple[Move, ...]:
    """Return the moves whose recorded steering and throttle are not the usual ones for their names.
    A move's values are the steering and throttle that more than half of its pictures have."""
    said: dict[Action, list[Point]] = {}
    for shot in shots:
        if shot.label is not None and shot.does is not None:
            said.setdefault(shot.label, []).append(shot.does)
    usual = ((label, mode(points), points) for label, points in said.items())
    return tuple(
        Move(label, steering=at.steering, throttle=at.throttle)
        for label, at, points in usual
        if 2 * points.count(at) > len(points) and at != point_of(label)
    )


def _counted(places: list[str]) -> str:
    """Return the locations as text: all of them, or their number and the first few."""
    if len(places) <= _MOST_PLACES:
        return ", ".join(places)
    return f"{len(places)}, the first in {', '.join(places[:_MOST_PLACES])}"


def _shown(text: str) -> str:
    """Remove terminals' control characters, because names come from untrusted files."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)
