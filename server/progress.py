"""What the page shows of the training: how agreement rose, and what is in the gallery.

The loop's thread only records here; pictures are fetched from the learner when a page asks,
and kept until something is taught or changed.
"""

from __future__ import annotations

import asyncio
import math
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from robot.clock import Clock
from robot.control.loop import ControlLoop
from robot.control.readiness import Readiness
from robot.control.state import Tick
from robot.lifecycle import StartStop
from robot.policy.history import Replaced, Taught, Undone
from robot.policy.policy import LearnedImage

MARK_EVERY = 10
"""Examples between two marks of the curve."""
_MARKS = 2000
_REMEMBERED = 512
"""So many images are remembered, also those that are no longer there."""
_REFRESH_S = 0.4
"""The gallery of a robot that learns is fetched no more often than so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """How things stood after so many examples. `at_s` is in seconds since 1970."""

    lessons: int
    agreement: float
    at_s: float
    episode: str | None = None


class Progress(StartStop):
    """Follows one robot's training. A context manager: it follows inside the block."""

    def __init__(
        self,
        loop: ControlLoop,
        clock: Clock,
        episode: Callable[[], str | None] = lambda: None,
    ) -> None:
        self._loop = loop
        self._clock = clock
        self._episode = episode
        self.readiness = Readiness()
        self._marks: list[Mark] = []
        self._gallery: list[LearnedImage] = []
        self._seen: OrderedDict[int, LearnedImage] = OrderedDict()
        self._is_stale = True
        self._fetched_s = -math.inf
        self._unsubscribe: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Begin to follow the loop."""
        self._unsubscribe = self._loop.subscribe(self.note)

    def stop(self) -> None:
        """End following."""
        self._unsubscribe()

    def note(self, tick: Tick) -> None:
        """Take note of one tick, on the loop's thread."""
        self.readiness.note(tick)
        if not tick.history_events:
            return
        self._is_stale = True
        lessons = self._loop.history.policy.n_seen
        for event in tick.history_events:
            if isinstance(event, Replaced):
                self._marks = []
                self._seen = OrderedDict()  # its images have the same numbers as others
            elif isinstance(event, Undone):
                self._marks = [mark for mark in self._marks if mark.lessons <= lessons]
            elif isinstance(event, Taught):
                self._mark(lessons)

    def _mark(self, lessons: int) -> None:
        agreement = self._loop.state.agreement
        last = self._marks[-1].lessons if self._marks else 0
        if agreement is None or lessons - last < MARK_EVERY:
            return
        mark = Mark(
            lessons=lessons,
            agreement=agreement,
            at_s=self._clock.wall_s(),
            episode=self._episode(),
        )
        self._marks = [*self._marks[-_MARKS:], mark]

    def history(self, points: int = 200) -> list[Mark]:
        """Return at most so many marks, spread over the whole training, oldest first."""
        marks = self._marks
        step = max(1, -(-len(marks) // points))
        return marks[::-1][::step][::-1]

    def mark_of(self, lesson: int) -> Mark | None:
        """Return the mark that covers an example; None if it was taught before this start."""
        marks = self._marks
        at = bisect_left(marks, lesson, key=lambda mark: mark.lessons)
        if lesson < 1 or at == len(marks):
            return None
        is_covered = at > 0 or marks[0].lessons - lesson < MARK_EVERY
        return marks[at] if is_covered else None

    async def gallery(self, *, fresh: bool = False) -> list[LearnedImage]:
        """Return the learned images; `fresh` after a change made just now."""
        now_s = self._clock.now_s()
        if fresh or (self._is_stale and now_s - self._fetched_s > _REFRESH_S):
            self._is_stale, self._fetched_s = False, now_s
            history = self._loop.history
            request = self._loop.submit(lambda: history.policy.gallery())
            self._gallery = await asyncio.wrap_future(request)
            self._remember(self._gallery)
        return self._gallery

    async def image(self, node: int) -> LearnedImage | None:
        """Return a learned image, as it was last seen if it has been merged since.

        A page asks for what it was told a moment ago, and an image may be merged with every
        example: what it was is then still the best answer. None for one never seen.
        """
        await self.gallery()
        if node not in self._seen:
            await self.gallery(fresh=True)
        return self._seen.get(node)

    def _remember(self, images: list[LearnedImage]) -> None:
        for image in images:
            self._seen[image.node_id] = image
            self._seen.move_to_end(image.node_id)
        while len(self._seen) > max(_REMEMBERED, 2 * len(images)):
            self._seen.popitem(last=False)
