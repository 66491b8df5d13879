"""The journal: all changes of the learner, each numbered and written as soon as it is made.

Written entries survive a kill of the program. A power cut loses at most the entries since the last
`fsync`. The disk's thread calls `fsync` five times a second, so writes never wait for a slow disk.

The journal is the source of truth (a write-ahead log); a model's file is a cache of it. An entry's
number has two parts: the number of the program's start, which is in the file's name, and the count
of changes since then. The number does not depend on a clock.
"""

from __future__ import annotations

import secrets
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from robot.control.state import Tick
from robot.policy.events import Edited, HistoryEvent, Taught
from robot.policy.history import TrainingHistory
from robot.store.models.model import JournalPosition, Model, take_model

_MOST_WAITING = 8192
_TRY_AGAIN_S = 5.0
Record = tuple[dict[str, Any], HistoryEvent | Model | None]
"""A record: a head and data. The head has the latest change's number, `change`, and a `kind`:
- `event`: the data is the change itself;
- `checkpoint`: the data is the complete learner; the head also has the model's `name`;
- `saved`: all changes up to this one are saved in a model's file;
- `drive`: a drive began after this change, so the policy was reset."""


class Journal:
    """Queues the numbered changes of the learner for a `JournalWriter`. The writer calls `take` and
    `require_checkpoint`, and sets `boot`. `note` and `copy` are for the loop's thread."""

    def __init__(self) -> None:
        self.run = secrets.token_hex(8)
        self.boot = 0
        self.wake: Callable[[], None] = lambda: None
        self._lock = threading.Lock()
        self._queue: deque[Record] = deque()
        self._needs_checkpoint = True
        self._try_again_s = 0.0
        self._drives = 0

    def note(
        self, history: TrainingHistory, in_use: Callable[[], tuple[str | None, str]], tick: Tick
    ) -> None:
        """Process one tick; `in_use` returns the model's name and place."""
        events, must = tick.history_events, self._needs_checkpoint
        drives, self._drives = self._drives, history.drives
        if drives != history.drives and not must:
            self._put(({"kind": "drive", "change": history.changes - len(events)}, None))
        if must and tick.now_s < self._try_again_s:
            return
        if not events and not (must and self._try_again_s > 0.0):
            return
        if must or not all(isinstance(event, Taught | Edited) for event in events):
            self._try_again_s = tick.now_s + _TRY_AGAIN_S
            self._needs_checkpoint = False
            name, place = in_use()
            head = {"kind": "checkpoint", "change": history.changes, "name": name}
            self._put((head, self.copy(history, place)))
            return
        first = history.changes - len(events) + 1
        self._put(*(({"kind": "event", "change": n}, one) for n, one in enumerate(events, first)))

    def copy(self, history: TrainingHistory, place: str) -> Model:
        """Copy the learner's current state with its journal position."""
        position = self.position(history.changes)
        return take_model(history.policy, history.taught, place=place, position=position)

    def position(self, change: int) -> JournalPosition:
        return JournalPosition(run=self.run, boot=self.boot, change=change)

    def _put(self, *records: Record) -> None:
        with self._lock:
            if len(self._queue) >= _MOST_WAITING:
                self._queue.clear()
                self._needs_checkpoint = True
                return
            self._queue.extend(records)
        self.wake()

    def note_saved(self, change: int) -> None:
        """Record that all changes up to this one are saved, so that recovery does not need them."""
        self._put(({"kind": "saved", "change": change}, None))

    def take(self) -> list[Record]:
        """Return and remove the queued records."""
        with self._lock:
            records = list(self._queue)
            self._queue.clear()
        return records

    def require_checkpoint(self, *, has_failed: bool) -> None:
        """Make the next record contain the complete learner. After a failed write (`has_failed`)
        the record is written after `_TRY_AGAIN_S`, even if nothing changes."""
        if not has_failed:
            self._try_again_s = 0.0  # the loop reads both values, so set this one first
        self._needs_checkpoint = True
