"""Begins and ends the recording of a run. A recording contains the learner twice: as it was at the
beginning and at the end."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from robot.control.loop import ControlLoop
from robot.recordings.writer import describe_run
from robot.store.models.model import Model, take_model

if TYPE_CHECKING:
    from robot.recordings.recorder import RecordingQueue


class RecordedRun:
    """The current run of a control loop. `about` describes the robot. Call its methods on the
    loop's thread.

    Attributes:
        base: The learner at the beginning of the next recording; None until it is known.
        is_open: True while a recording is being written.
        is_kept: True if the learner changed or the robot moved; otherwise the recording is
            discarded.
        n_taught: Number of examples that the recording contains, minus those that were undone.
    """

    def __init__(self, loop: ControlLoop, queue: RecordingQueue, about: Mapping[str, Any]) -> None:
        self._loop, self._queue, self._about = loop, queue, about
        self._run_id = secrets.token_hex(8)
        self.base: Model | None = None
        self.is_open = self.is_kept = False
        self.n_taught = 0

    def begin(self, now_s: float) -> None:
        """Begin a recording."""
        wall_ns = round(1e9 * self._loop.clock.wall_s())
        state, frame = self._loop.state, self._loop.learning.frame
        run = describe_run(
            episode_id=make_id(wall_ns),
            run_id=self._run_id,
            origin_ns=wall_ns - round(now_s * 1e9),
            started_at_s=wall_ns / 1e9,
            learner=state.learner,
            moves=tuple(move.value for move in state.moves),
            pictures=None if frame is None else frame.encoding,
            **self._about,
        )
        self._queue.begin(run, self.base)
        self.is_open, self.is_kept, self.n_taught = True, False, 0

    def finish(self) -> None:
        """End the recording, if one is open, with the learner's present state."""
        if self.is_open:
            self.take_base()
            self.end(final=self.base)

    def end(self, final: Model | None) -> None:
        """End the recording, if one is open; `final` is the learner's state, None if unknown."""
        if self.is_open:
            self._queue.end(final, is_kept=self.is_kept)
            self.is_open = False

    def take_base(self) -> None:
        """Copy the learner's present state."""
        history, wall_s = self._loop.history, self._loop.clock.wall_s()
        self.base = take_model(history.policy, history.taught, saved_at_s=wall_s)


def make_id(wall_ns: int) -> str:
    """Name a recording by its time, in UTC, so that names sort by time."""
    at = datetime.fromtimestamp(wall_ns / 1e9, UTC)
    return f"{at:%Y-%m-%d_%H%M%S}_{wall_ns // 10**6 % 1000:03d}"
