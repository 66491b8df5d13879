"""Writes a session's events to disk on a thread of its own: the control loop never waits for it."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterable
from pathlib import Path

from robot.clock import Clock
from robot.study.events import StudyEvent, whole_lines, write_events
from robot.types import StartStop

log = logging.getLogger(__name__)
FLUSH_EVERY_S = 1.0


class EventLog(StartStop):
    """Appends to one file. What the disk refuses is kept, and tried again every second."""

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path = path
        self._clock = clock
        self._lock = clock.lock()
        self._waiting: list[StudyEvent] = []
        self._ending = threading.Event()
        self.fault = ""
        """Why nothing could be written the last time; empty if it could."""

    def start(self) -> None:
        """Cut off a line that a power cut left half written, and begin to write.

        Raises:
            OSError: If the file cannot be written.
        """
        self._path.parent.mkdir(parents=True, exist_ok=True)
        data = self._path.read_bytes() if self._path.exists() else b""
        whole = whole_lines(data) or write_events([], with_head=True).encode()
        if whole != data:
            self._path.write_bytes(whole)
        self._thread = self._clock.start_thread(self._run, "study-log")

    def stop(self) -> None:
        self._ending.set()
        self._thread.join(timeout=5.0)
        self._try()

    def add(self, events: Iterable[StudyEvent]) -> None:
        """Queue events; returns at once, on any thread."""
        self._waiting.extend(events)

    def flush(self) -> None:
        """Have all events on the disk when this returns.

        Raises:
            OSError: If the disk refuses: they are kept for the next time.
        """
        with self._lock:
            events = self._waiting[:]
            if not events:
                return
            size = self._path.stat().st_size
            try:
                with self._path.open("ab") as file:
                    file.write(write_events(events).encode())
                    file.flush()
                    os.fsync(file.fileno())
            except OSError:
                os.truncate(self._path, size)
                raise
            del self._waiting[: len(events)]
            self.fault = ""

    def _run(self) -> None:
        while not self._clock.wait(self._ending, FLUSH_EVERY_S):
            self._try()

    def _try(self) -> None:
        try:
            self.flush()
        except OSError as error:
            log.warning("the session's events are not on the disk yet: %s", error)
            self.fault = f"Nothing can be written: {error.strerror or error}"
