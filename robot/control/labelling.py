"""Which frames a pilot's command labels. Pure.

A command says what is held and which frame the pilot was looking at. That frame gets the label,
and so do the frames between it and the one that the previous command named: they carry what was
held then, because a change is always sent at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from robot.types import Action, PilotCommand


class Labeller:
    """Turns the pilot's commands of one drive into (frame id, label) pairs, each frame once."""

    def __init__(self) -> None:
        self._previous: PilotCommand | None = None
        self._last_frame_id = 0

    def reset(self) -> None:
        """Forget what was held: a new drive begins. No frame is labelled twice even so."""
        self._previous = None

    def label(
        self, command: PilotCommand, known_frame_ids: Iterable[int]
    ) -> Iterator[tuple[int, Action]]:
        """Yield the frames that `command` labels, oldest first.

        Args:
            command: The pilot's newest command.
            known_frame_ids: Ids still remembered, ascending; others cannot be labelled.
        """
        if command.frame_id is None:
            return
        before = self._previous.held if self._previous else None
        for frame_id in known_frame_ids:
            if self._last_frame_id < frame_id < command.frame_id and before is not None:
                yield frame_id, before
            elif frame_id == command.frame_id > self._last_frame_id and command.held is not None:
                yield frame_id, command.held
        self._last_frame_id = max(self._last_frame_id, command.frame_id)
        self._previous = command
