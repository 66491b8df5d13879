"""Describes a run for its recording: the recording's name, the robot, and the learner."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from robot.control.loop import ControlLoop
from robot.recordings.writer import describe_run
from robot.store.models.model import Model, take_model


def run_of(
    loop: ControlLoop, run_id: str, now_s: float, about: Mapping[str, Any]
) -> dict[str, str]:
    """Describe a recording that begins at `now_s`; `about` describes the robot."""
    wall_ns = round(1e9 * loop.clock.wall_s())
    state, frame = loop.state, loop.learning.frame
    return describe_run(
        episode_id=make_id(wall_ns),
        run_id=run_id,
        origin_ns=wall_ns - round(now_s * 1e9),
        started_at_s=wall_ns / 1e9,
        learner=state.learner,
        moves=tuple(move.value for move in state.moves),
        pictures=None if frame is None else frame.encoding,
        **about,
    )


def learner_of(loop: ControlLoop) -> Model:
    """Copy the learner's present state, on the loop's thread."""
    history = loop.history
    return take_model(history.policy, history.taught, saved_at_s=loop.clock.wall_s())


def make_id(wall_ns: int) -> str:
    """Name a recording by its time, in UTC, so that names sort by time."""
    at = datetime.fromtimestamp(wall_ns / 1e9, UTC)
    return f"{at:%Y-%m-%d_%H%M%S}_{wall_ns // 10**6 % 1000:03d}"
