"""Stores a small number for each frame, in two bytes, for recordings of any length."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from robot.policy.events import HistoryEvent, Taught, Undone
from robot.policy.history import UNDO_HORIZON_S
from robot.types import Action

_PAGE = 4096
_KEPT_S = 2 * UNDO_HORIZON_S
"""How long the label of a taught example is remembered, in seconds. An undo can reach back slightly
further than `UNDO_HORIZON_S`, but never as far as this time."""


class FrameMarks:
    """A number from 0 to 65,535 for each frame id; 0 if no number was set."""

    def __init__(self) -> None:
        self._pages: dict[int, array[int]] = {}
        self._newest_s: dict[int, float] = {}
        """The time at which the newest example of each page was taught. A page is `_PAGE`
        successive frame ids."""

    def __getitem__(self, frame_id: int) -> int:
        page, index = divmod(frame_id, _PAGE)
        numbers = self._pages.get(page)
        return numbers[index] if numbers is not None else 0

    def __setitem__(self, frame_id: int, number: int) -> None:
        page, index = divmod(frame_id, _PAGE)
        if page not in self._pages:
            self._pages[page] = array("H", bytes(2 * _PAGE))
        self._pages[page][index] = number

    def set_taught(self, frame_id: int, number: int, at_s: float) -> None:
        """Set the number of an example that was taught at `at_s`. Forget examples that can no
        longer be undone, so that memory does not grow with the recording."""
        page = frame_id // _PAGE
        if page not in self._pages:
            for old in [p for p, newest_s in self._newest_s.items() if newest_s < at_s - _KEPT_S]:
                del self._newest_s[old], self._pages[old]
        self[frame_id] = number
        self._newest_s[page] = at_s


class Tally:
    """Counts the pictures of a recording, and its examples of each label that were not undone.

    `before` are the counts of the recording's earlier files, as `counts` returns them.
    """

    def __init__(self, before: Mapping[str, Any] | None = None) -> None:
        counts = {"frames": 0, "taught": {}, "first_ns": 2**64, **(before or {})}
        self.frames_before = self.frames = int(counts["frames"])
        taught = {Action(label): int(count) for label, count in counts["taught"].items()}
        self.taught: Counter[Action] = Counter(taught)
        self.first_ns, self.last_ns = int(counts["first_ns"]), 0
        """The first and the last log time of the recording, in nanoseconds since 1970."""
        self._has_picture, self._label_of = FrameMarks(), FrameMarks()
        self._labels: list[Action] = []

    @property
    def counts(self) -> dict[str, Any]:
        """The counts of the recording so far, as JSON."""
        taught = {label: count for label, count in self.taught.items() if count}
        return {"frames": self.frames, "taught": taught, "first_ns": self.first_ns}

    def next(self) -> Tally:
        """Return a new tally that continues these counts in the recording's next file. Do not use
        the old tally after the call."""
        tally = Tally(self.counts)
        tally._label_of, tally._labels = self._label_of, self._labels
        return tally

    def note_time(self, stamp_ns: int) -> None:
        self.first_ns = min(stamp_ns, self.first_ns)
        self.last_ns = max(stamp_ns, self.last_ns)

    def note_frame(self, frame_id: int) -> None:
        self.frames += not self._has_picture[frame_id]
        self._has_picture[frame_id] = 1

    def note(self, event: HistoryEvent) -> None:
        """Count the examples that an event teaches or undoes."""
        if isinstance(event, Taught):
            frame_id, label = event.example.frame_id, event.example.label
            if label not in self._labels:
                self._labels.append(label)
            self._drop(frame_id)
            self.taught[label] += 1
            self._label_of.set_taught(frame_id, self._labels.index(label) + 1, event.at_s)
        elif isinstance(event, Undone):
            for frame_id in event.frame_ids:
                self._drop(frame_id)

    def note_earlier(self, events: Iterable[HistoryEvent]) -> None:
        """Note the labels of earlier events without counting them, because `before` includes
        them."""
        counted = self.taught.copy()
        for event in events:
            self.note(event)
        self.taught = counted

    def _drop(self, frame_id: int) -> None:
        if number := self._label_of[frame_id]:
            self.taught[self._labels[number - 1]] -= 1
            self._label_of[frame_id] = 0
