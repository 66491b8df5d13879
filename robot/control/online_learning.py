"""Perception and online learning: predicts a move for each new frame, and learns the pilot's moves.

A command contains the held move and the frame that the pilot was looking at. This frame gets the
move as its label. Frames between this frame and the frame of the previous command get the move that
was held before, because the page sends every change of the held move immediately. A frame is
labelled a little after it was processed, so the feature vectors of the last frames are kept.
"""

from __future__ import annotations

import contextlib
import logging
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

from robot.clock import Clock
from robot.control.state import Timing
from robot.learner.base import Vector
from robot.moves import Move
from robot.policy.events import HistoryEvent, Replaced, Undone
from robot.policy.history import TrainingHistory
from robot.policy.policy import Policy
from robot.types import Action, Example, Frame, PilotCommand, Point, Prediction

log = logging.getLogger(__name__)

WINDOW_S = 10.0
"""Time that `Agreement` covers, in seconds. A window of a hundred examples would be too short: at
thirty examples a second, they could all come from one straight stretch."""


class Agreement:
    """The share of examples whose label was predicted, over the last `WINDOW_S` seconds."""

    def __init__(self) -> None:
        self._examples: deque[tuple[float, bool]] = deque()
        self._n_right = 0

    @property
    def n_examples(self) -> int:
        """Number of examples in the window."""
        return len(self._examples)

    @property
    def share(self) -> float | None:
        """Share of the examples that were predicted correctly; None before the first example."""
        return self._n_right / len(self._examples) if self._examples else None

    def add(self, at_s: float, *, is_right: bool) -> None:
        """Add an example that was predicted before it was learned. `at_s` never decreases."""
        self._examples.append((at_s, is_right))
        self._n_right += is_right
        while self._examples[0][0] <= at_s - WINDOW_S:
            self._n_right -= self._examples.popleft()[1]

    def drop_after(self, at_s: float) -> None:
        """Drop the examples after the teaching time `at_s`, because they were undone."""
        while self._examples and self._examples[-1][0] > at_s:
            self._n_right -= self._examples.pop()[1]


class Labeller:
    """Makes labels from the pilot's commands of one drive; each frame gets at most one label."""

    def __init__(self) -> None:
        self._previous: PilotCommand | None = None
        self._last_frame_id = 0

    def reset(self) -> None:
        """Forget the held move, because a new drive begins. Frames that already have a label are
        not labelled again."""
        self._previous = None

    def label(
        self, command: PilotCommand, known_frame_ids: Iterable[int]
    ) -> Iterator[tuple[int, Action, Point | None]]:
        """Yield each frame that a new command labels, with its move and point, oldest first.

        `known_frame_ids` are the remembered frames, ascending; no other frame can be labelled.
        """
        if command.frame_id is None:
            return
        for frame_id in known_frame_ids:
            if self._last_frame_id < frame_id <= command.frame_id:
                said = command if frame_id == command.frame_id else self._previous
                if said is not None and said.held is not None:
                    yield frame_id, said.held, said.point
        self._last_frame_id = max(self._last_frame_id, command.frame_id)
        self._previous = command


CORRECTS_BEYOND = 0.1
"""Difference in steering above which a proportional command corrects the robot."""
MEMORY_FRAMES = 64
"""Number of newest frames that a command can label: two seconds at 30 frames a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Seen:
    """A frame that can still be labelled."""

    x: Vector
    captured_s: float
    delivered_s: float
    predicted: Action | None
    point: Point | None

    def differs(self, label: Action, point: Point | None) -> bool:
        """Return whether a label corrects the move that the robot proposed for this frame. If the
        pilot does not steer proportionally, each label is a correction, even if the robot proposed
        the same move."""
        if point is None or self.point is None or label is not self.predicted:
            return True
        return abs(point.steering - self.point.steering) > CORRECTS_BEYOND


class OnlineLearning:
    """Predicts and learns; only one thread may use it.

    Attributes:
        history: The training history, which teaches the policy and can undo teaching.
        frame: The newest frame that was processed.
        prediction: The policy's proposal on that frame.
        agreement: Agreement of the proposals with the pilot's moves.
        timings: Times of predicting and learning, by name.
        fault: Why the learner failed on the newest frame or example; None if it did not fail.
        failure: Like `fault`, but kept until another learner is used.
        error: The exception that belongs to `failure`.
    """

    def __init__(self, policy: Policy, clock: Clock, declared: Collection[Move] = ()) -> None:
        self._clock = clock
        self._events: list[HistoryEvent] = []
        self.history = TrainingHistory(policy, self._note_events, declared)
        self.fault: str | None = None
        self.failure: str | None = None
        self.error: Exception | None = None
        self.frame: Frame | None = None
        self.prediction: Prediction | None = None
        self.agreement = Agreement()
        self.timings = {"propose": Timing(), "learn": Timing()}
        self._labeller = Labeller()
        self._seen: dict[int, _Seen] = {}

    def look(
        self,
        frame: Frame | None,
        under_way: Action | None = None,
        *,
        delivered_s: float | None = None,
        **drive: bool,
    ) -> bool:
        """Process the camera's newest frame; return False if there is none or it is not new.

        `delivered_s` is the time at which the frame reached the loop; None means the frame's
        capture time. The other arguments are passed to `Policy.propose`. Raises CameraError if the
        frame cannot be decoded; the frame then counts as not seen.
        """
        if frame is None or (self.frame is not None and frame.frame_id == self.frame.frame_id):
            return False
        policy = self.history.policy
        x = policy.extract(frame)
        self.frame = frame
        started_s = self._clock.now_s()
        prediction = Prediction(frame_id=frame.frame_id)  # empty if the learner fails
        with self._guarded():
            prediction = policy.propose(
                frame.frame_id,
                x,
                under_way=under_way,
                at_s=frame.captured_s,
                **drive,
            )
            self.fault = None
        self.prediction = prediction
        self._note_time("propose", started_s)
        self._seen[frame.frame_id] = _Seen(
            x=x,
            captured_s=frame.captured_s,
            delivered_s=frame.captured_s if delivered_s is None else delivered_s,
            predicted=prediction.action,
            point=prediction.point,
        )
        while len(self._seen) > MEMORY_FRAMES:
            del self._seen[next(iter(self._seen))]
        return True

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        """Record errors and go on: learners may be third-party plugins."""
        try:
            yield
        except Exception as error:
            fault = f"The learner failed and proposes no move: {str(error) or repr(error)}"[:300]
            if fault != self.failure:  # log the fault once, not thirty times a second
                log.error("the learner failed", exc_info=error)
            self.fault = self.failure = fault
            self.error = error

    @property
    def newest(self) -> tuple[Vector, Prediction] | None:
        """The newest frame's vector and the proposal on it; None before the first frame."""
        if self.prediction is None:
            return None
        return self._seen[self.prediction.frame_id].x, self.prediction

    def learn(
        self, commands: Sequence[PilotCommand], *, is_intervention: bool, may_learn: bool
    ) -> None:
        """Learn the frames that the commands label; skip these frames if `may_learn` is False."""
        lessons: list[tuple[Example, Vector, float]] = []
        for command in commands:
            for frame_id, label, point in self._labeller.label(command, self._seen):
                seen = self._seen[frame_id]
                differs = is_intervention and seen.differs(label, point)
                example = Example(
                    frame_id=frame_id, label=label, is_intervention=differs, point=point
                )
                lessons.append((example, seen.x, seen.captured_s))
        if not may_learn:
            return
        step = self.history.batch
        for first in range(0, len(lessons), step):
            batch, started_s = lessons[first : first + step], self._clock.now_s()
            with self._guarded():
                for event in self.history.teach_all(batch):
                    predicted = self._seen[event.example.frame_id].predicted
                    self.agreement.add(event.at_s, is_right=predicted is event.example.label)
                self._note_time("learn", started_s, len(batch))

    def reset(self) -> None:
        """Forget the state of the drive that ends."""
        self._labeller.reset()
        with self._guarded():
            self.history.begin_drive()

    def times_of(
        self, frame_id: int | None, seen_id: int | None = None
    ) -> tuple[tuple[float, float], float] | None:
        """Return the capture and delivery times of the frame `frame_id`, and the delivery time of
        the older of the frames `frame_id` and `seen_id`. A forgotten frame gets the times of the
        oldest remembered frame. Return None before the first frame, or if `frame_id` is None."""
        if not self._seen or frame_id is None:
            return None
        newest_id, oldest = next(reversed(self._seen)), next(iter(self._seen.values()))
        named = self._seen.get(min(frame_id, newest_id), oldest)
        seen_id = frame_id if seen_id is None else min(seen_id, frame_id)
        seen = self._seen.get(min(seen_id, newest_id), oldest)
        return (named.captured_s, named.delivered_s), seen.delivered_s

    def take_events(self) -> tuple[HistoryEvent, ...]:
        """Return and remove the latest changes of the learner, in order."""
        events = tuple(self._events)
        self._events.clear()
        return events

    def _note_events(self, events: Sequence[HistoryEvent]) -> None:
        self._events += events
        for event in events:
            if isinstance(event, Replaced):
                self.agreement = Agreement()
                self.fault = self.failure = self.error = None
            elif isinstance(event, Undone):
                self.agreement.drop_after(self.history.teaching_s)

    def _note_time(self, name: str, started_s: float, n: int = 1) -> None:
        before, taken_s = self.timings[name], self._clock.now_s() - started_s
        self.timings[name] = Timing(before.count + n, before.total_s + taken_s)
