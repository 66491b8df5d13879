"""A drive from another program, to be imported as an episode."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robot.clock import RealClock
from robot.devices.pictures import Picture
from robot.driver import CLASSIC, Move
from robot.errors import RecordingError
from robot.exchange.report import ImportReport
from robot.policy.history import Taught
from robot.store.episodes.messages import COMMAND, LESSON, describe_command
from robot.store.episodes.writer import EpisodeWriter, describe_run
from robot.store.folder import whole_file
from robot.store.models.events import describe_event
from robot.types import DEFAULT_MOVES, Action, Example, Frame, PilotCommand, Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """One picture of a drive, with its label if it has one. `t_s` counts from the beginning.

    `point` is the label by degrees, if it was meant so.
    """

    t_s: float
    picture: Picture
    label: Action | None
    point: Point | None = None
    is_intervention: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A drive: its name, its source, and its shots, read one at a time."""

    name: str
    source: str
    shots: Iterable[Shot]
    moves: tuple[Action, ...] = DEFAULT_MOVES
    declared_moves: tuple[Move, ...] = ()
    started_at_s: float = 0.0
    """Seconds since 1970; 0 if it is not known."""
    report: ImportReport = field(default_factory=ImportReport)


def write_episode(drive: Drive, path: Path, *, on_shot: Callable[[], None] = lambda: None) -> int:
    """Write a drive as an episode; return how many pictures it has.

    Raises:
        RecordingError: If the drive is broken or empty; then no file is left.
        OSError: If the disk refuses; no file is left either.
    """
    is_past = 0 < drive.started_at_s <= RealClock().wall_s()
    started_at_s = drive.started_at_s if is_past else 0.0  # unknown: never newer than a drive here
    run = describe_run(
        episode_id=path.stem,
        run_id=path.stem,
        origin_ns=round(started_at_s * 1e9),
        started_at_s=started_at_s,
        moves=tuple(move.value for move in drive.moves),
        declared_moves=drive.declared_moves,
        source=drive.source,
    )
    with whole_file(path) as file:
        writer = EpisodeWriter(file, run)
        for frame_id, shot in enumerate(drive.shots, start=1):
            _write_shot(writer, frame_id, shot)
            on_shot()
        if not writer.frames:
            why = drive.report.why_nothing()
            raise RecordingError(f"{drive.name} has no pictures to use{why}")
        writer.close({"dropped_frames": "0", "lost_words": "0"})
    return writer.frames


def _write_shot(writer: EpisodeWriter, frame_id: int, shot: Shot) -> None:
    picture = shot.picture
    frame = Frame(
        frame_id=frame_id,
        captured_s=shot.t_s,
        width=picture.width,
        height=picture.height,
        encoding=picture.encoding,
        data=picture.data,
    )
    writer.write_frame(frame)
    if shot.label is None:
        return
    command = PilotCommand(
        held=shot.label,
        frame_id=frame_id,
        seq=frame_id,
        received_s=shot.t_s,
        point=shot.point,
    )
    writer.write_message(COMMAND, shot.t_s, describe_command(command))
    example = Example(
        frame_id=frame_id,
        label=shot.label,
        is_intervention=shot.is_intervention,
        point=shot.point,
    )
    taught = Taught(example=example, x=np.zeros(0), at_s=shot.t_s)
    writer.write_message(LESSON, shot.t_s, describe_event(taught))


def read_label(text: object, known: Collection[Action] = CLASSIC) -> Action | None:
    """Return the move of `known` that a text names, or None."""
    if not isinstance(text, str):
        return None
    try:
        label = Action(text.strip().lower())
    except ValueError:
        return None
    return label if label in known else None


def moves_with(labels: Iterable[Action | None]) -> tuple[Action, ...]:
    """Return the usual three moves and all other moves among the labels.

    If none of the three is among them, return only the drive's own moves.
    """
    found = list(dict.fromkeys(label for label in labels if label is not None))
    ordered = [move for move in CLASSIC if move in found]
    ordered += [move for move in found if move not in CLASSIC]
    if found and not set(found) & set(DEFAULT_MOVES):
        return tuple(ordered)
    return DEFAULT_MOVES + tuple(move for move in ordered if move not in DEFAULT_MOVES)
