"""A small number for each frame, in two bytes, for recordings of any length."""

from __future__ import annotations

from array import array
from collections import Counter

from robot.policy.history import HistoryEvent, Taught, Undone
from robot.types import Action

_PAGE = 4096


class FrameMarks:
    """Numbers from 0 to 65,535 by frame id; 0 if no number was set."""

    def __init__(self) -> None:
        self._pages: dict[int, array[int]] = {}

    def __getitem__(self, frame_id: int) -> int:
        page, index = divmod(frame_id, _PAGE)
        numbers = self._pages.get(page)
        return numbers[index] if numbers is not None else 0

    def __setitem__(self, frame_id: int, number: int) -> None:
        page, index = divmod(frame_id, _PAGE)
        if page not in self._pages:
            self._pages[page] = array("H", bytes(2 * _PAGE))
        self._pages[page][index] = number


class Tally:
    """Counts the pictures of a recording, and its examples of each label that were not undone."""

    def __init__(self) -> None:
        self.frames = 0
        self.taught: Counter[Action] = Counter()
        self._has_picture, self._label_of = FrameMarks(), FrameMarks()
        self._labels: list[Action] = []

    def note_frame(self, frame_id: int) -> None:
        self.frames += not self._has_picture[frame_id]
        self._has_picture[frame_id] = 1

    def note(self, event: HistoryEvent) -> None:
        """Count the examples that an event teaches or undoes."""
        if isinstance(event, Taught):
            label = event.example.label
            if label not in self._labels:
                self._labels.append(label)
            self._set(event.example.frame_id, self._labels.index(label) + 1)
        elif isinstance(event, Undone):
            for frame_id in event.frame_ids:
                self._set(frame_id, 0)

    def _set(self, frame_id: int, number: int) -> None:
        if before := self._label_of[frame_id]:
            self.taught[self._labels[before - 1]] -= 1
        if number:
            self.taught[self._labels[number - 1]] += 1
        if before or number:
            self._label_of[frame_id] = number
