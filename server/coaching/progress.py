"""The training progress that the page shows: the curve of agreement over the examples.

The control loop's thread records each tick, and the routes read the curve.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

from robot.coaching.lesson import Lesson
from robot.coaching.trail import Trail
from robot.control.loop import ControlLoop
from robot.control.state import Tick
from robot.policy.events import Replaced, Taught, Undone
from server.coaching.gallery import Gallery
from server.persistence import Persistence

MARK_EVERY = 10
"""Examples between two points of the curve."""
_MARKS, _POINTS = 2000, 200


@dataclass(frozen=True, slots=True)
class Mark:
    """One point of the curve: the agreement after `n_examples`. `at_s` is in seconds since 1970."""

    n_examples: int
    agreement: float
    at_s: float
    episode: str | None


class _Curve:
    """Marks in ascending order, stored as columns to save memory. Marks are only added, so one
    thread may add while others read."""

    def __init__(self) -> None:
        self._n_examples, self._agreement, self._at_s = array("L"), array("d"), array("d")
        self._episodes: list[str | None] = []

    def __len__(self) -> int:
        return len(self._n_examples)

    def __getitem__(self, index: int) -> Mark:
        numbers = self._n_examples[index], self._agreement[index], self._at_s[index]
        return Mark(*numbers, self._episodes[index])

    def add(self, mark: Mark) -> None:
        self._episodes.append(mark.episode)
        self._at_s.append(mark.at_s)
        self._agreement.append(mark.agreement)
        self._n_examples.append(mark.n_examples)  # last, because `__len__` reads this column

    def part(self, first: int, end: int) -> _Curve:
        """Return the marks at these indices as a new curve."""
        curve = _Curve()
        for index in range(first, end):
            curve.add(self[index])
        return curve

    def until(self, n_examples: int) -> _Curve:
        """Return the marks up to this number of examples as a new curve."""
        return self.part(0, bisect_right(self._n_examples, n_examples))

    def place(self, example: int) -> int:
        """Return the index of the first mark at or after an example."""
        return bisect_left(self._n_examples, example)


class Progress:
    """Tracks one robot's training. The extension subscribes `listeners` to the loop's ticks."""

    def __init__(self, loop: ControlLoop, persistence: Persistence | None = None) -> None:
        self._loop = loop
        self._persistence = persistence
        self.lesson = Lesson()
        self.trail = Trail()
        self.listeners = self.lesson.note, self.trail.note, self.note
        self._marks = _Curve()
        self.gallery = Gallery(loop)

    def note(self, tick: Tick) -> None:
        """Record one tick. Only the loop's thread may call it."""
        if tick.prediction is not None and tick.prediction.node is not None:
            self.gallery.newest = max(self.gallery.newest, tick.prediction.node)
        if not tick.history_events:
            return
        self.gallery.is_stale = True
        n_examples = self._loop.history.policy.n_seen
        for event in tick.history_events:
            if isinstance(event, Replaced):
                self._marks = _Curve()
                self.gallery.forget()
            elif isinstance(event, Undone):
                self._marks = self._marks.until(n_examples)
            elif isinstance(event, Taught):
                self._mark(n_examples, tick.agreement)

    def _mark(self, n_examples: int, agreement: float | None) -> None:
        last = self._marks[-1].n_examples if self._marks else 0
        if agreement is None or n_examples - last < MARK_EVERY:
            return
        run = self._persistence.run if self._persistence is not None else None
        if len(self._marks) >= _MARKS + _POINTS:
            self._marks = self._marks.part(_POINTS, len(self._marks))
        self._marks.add(Mark(n_examples, agreement, self._loop.clock.wall_s(), run))

    def history(self) -> list[Mark]:
        """Return at most `_POINTS` marks that are spread over the whole training, oldest first."""
        marks = self._marks
        step = max(1, -(-len(marks) // _POINTS))
        return [marks[index] for index in range(len(marks) - 1, -1, -step)][::-1]

    def mark_of(self, example: int) -> Mark | None:
        """Return the mark that covers an example; None if it was taught in an earlier run."""
        marks = self._marks
        count, at = len(marks), marks.place(example)
        if example < 1 or at >= count:
            return None
        is_covered = at > 0 or marks[0].n_examples - example < MARK_EVERY
        return marks[at] if is_covered else None
