"""Writes a session's events to disk on a separate thread; the control loop never waits for it."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable
from pathlib import Path

from robot.clock import Clock
from robot.errors import reason
from robot.store.disk import DiskThread
from robot.study.events import StudyEvent, whole_lines, write_events

log = logging.getLogger(__name__)


class EventLog(DiskThread):
    """Appends events to one file; if a write fails, it tries again every second."""

    def __init__(self, path: Path, clock: Clock) -> None:
        super().__init__(clock, every_s=1.0)
        self.add(self._try)
        self._path = path
        self._lock = clock.lock()
        self._waiting: list[StudyEvent] = []
        self._size = 0
        self.fault = ""
        """The reason why the last write has failed; empty if it succeeded."""

    def start(self) -> None:
        """Remove a last line that a power cut left incomplete, and start the thread.

        Raises OSError if the file cannot be written.
        """
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("ab+") as file:
            file.seek(0)
            self._size = file.truncate(len(whole_lines(file.read())))
            if not self._size:
                self._size = file.write(write_events([], with_head=True).encode())
        super().start()

    def note(self, events: Iterable[StudyEvent]) -> None:
        """Queue events for writing; never blocks, and may be called on any thread."""
        self._waiting.extend(events)

    def flush(self) -> None:
        """Write all queued events to disk; if this raises OSError, they stay queued."""
        with self._lock:
            events = self._waiting[:]
            if not events:
                return
            size = min(self._size, self._path.stat().st_size)
            with self._path.open("ab") as file:
                file.truncate(size)  # remove an incomplete line of a failed write
                size += file.write(write_events(events).encode())
                file.flush()
                os.fsync(file.fileno())
            self._size = size
            del self._waiting[: len(events)]
            self.fault = ""

    def _try(self) -> None:
        try:
            self.flush()
        except OSError as error:
            log.warning("the session's events are not on the disk yet: %s", error)
            self.fault = f"Nothing can be written: {reason(error)}"
