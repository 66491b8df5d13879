"""The training progress that the page shows: the curve of agreement over the examples.

The server's event loop notes the agreement twice a second, and the routes read the curve.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

from robot.coaching.lesson import Lesson
from robot.coaching.trail import Trail
from robot.control.loop import ControlLoop
from robot.policy.policy import Policy
from server.coaching.gallery import Gallery
from server.persistence import Persistence

MARK_EVERY = 10
"""Minimum number of examples between two points of the curve."""
_SAMPLE_EVERY_S = 0.5
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
    """Tracks one robot's training. The extension subscribes `listeners` to the loop's ticks, and
    runs `follow` on the server's event loop."""

    def __init__(self, loop: ControlLoop, persistence: Persistence | None = None) -> None:
        self._loop = loop
        self._persistence = persistence
        self.lesson = Lesson()
        self.trail = Trail()
        self.listeners = self.lesson.note, self.trail.note
        self._policy: Policy | None = None
        self._marks = _Curve()
        self._before = 0  # the number of examples before the first that the curve covers
        self.gallery = Gallery(loop)

    async def follow(self) -> None:
        """Note the state of the loop every `_SAMPLE_EVERY_S` until cancelled."""
        while True:
            self.note()
            await self._loop.clock.pause(_SAMPLE_EVERY_S)

    def note(self) -> None:
        """Add the current agreement to the curve, if enough examples were taught since the last
        point. An undo removes points; another policy begins a new curve."""
        policy, state = self._loop.history.policy, self._loop.state
        n_examples, marks = sum(state.taught.values()), self._marks
        if policy is not self._policy:
            self._policy, self._marks, self._before = policy, _Curve(), policy.n_seen
            return
        last = marks[-1].n_examples if marks else self._before
        if n_examples < last:
            self._marks, self._before = marks.until(n_examples), min(self._before, n_examples)
        elif state.agreement is not None and n_examples - last >= MARK_EVERY:
            run = self._persistence.run if self._persistence is not None else None
            if len(marks) >= _MARKS + _POINTS:
                self._before = marks[_POINTS - 1].n_examples
                self._marks = marks.part(_POINTS, len(marks))
            wall_s = self._loop.clock.wall_s()
            self._marks.add(Mark(n_examples, state.agreement, wall_s, run))

    def history(self) -> list[Mark]:
        """Return at most `_POINTS` marks that are spread over the whole training, oldest first."""
        marks = self._marks
        step = max(1, -(-len(marks) // _POINTS))
        return [marks[index] for index in range(len(marks) - 1, -1, -step)][::-1]

    def mark_of(self, example: int) -> Mark | None:
        """Return the mark that covers an example; None if it was taught in an earlier run."""
        marks, at = self._marks, self._marks.place(example)
        return marks[at] if example > self._before and at < len(marks) else None
