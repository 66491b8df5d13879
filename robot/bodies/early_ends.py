"""Counts consecutive early ends: runs of the program that ended just as the robot began to drive.

The voltage of a weak battery collapses when the motors start. The computer or the program then
ends, a supervisor restarts it, and nobody learns why. The program therefore writes a marker file
when a drive begins. If the next run finds the marker, it counts one early end. There is no marker
after an update or Ctrl-C, or if somebody switches the robot off while it stands still.
"""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable
from pathlib import Path

from robot.clock import Worker
from robot.control.loop import ControlLoop
from robot.control.state import Tick
from robot.errors import UNREADABLE
from robot.store.folder import write_whole
from robot.store.records import read_regular
from robot.types import Action, Mode

log = logging.getLogger(__name__)
SOON_S = 5.0
"""Driving time after which the battery is considered strong enough, in seconds."""
ENOUGH = 2
"""Number of consecutive early ends after which the program warns of a weak battery."""
_AGAIN_S = 60.0
"""Minimum time between two markers, in seconds, to limit writes to the disk."""


class EarlyEnds:
    """Marks in a file that a drive has begun. The mark is removed when the robot has driven for
    `SOON_S`, or when the drive ends.

    Attributes:
        count: Number of early ends in a row, up to the previous run of the program.
    """

    def __init__(self, file: Path, on_strong: Callable[[], None] = lambda: None) -> None:
        """Read the previous run's marker. If the battery counts as weak, `on_strong` is called
        once the robot has driven for `SOON_S`."""
        self._file, self._on_strong = file, on_strong
        self.count = _read(file)
        self._is_marked = False
        self._moves_s: float | None = None
        self._strong_s: float | None = None
        self._wanted: bool | None = None
        self._due, self._ending = threading.Event(), False
        self._thread: Worker | None = None
        self._loop: ControlLoop | None = None
        self._unsubscribe: list[Callable[[], None]] = []

    @property
    def is_weak(self) -> bool:
        """True if the program has ended early so often that a person should be told."""
        return self.count >= ENOUGH

    def start(self, loop: ControlLoop) -> None:
        """Subscribe to the loop's changes of mode and, at the beginning of a drive, to all its
        ticks. Write markers on a separate thread, so that a slow disk does not block the loop."""

        def work() -> None:
            while not self._ending:
                loop.clock.wait(self._due, None)
                self._due.clear()
                self.write()

        self._thread = loop.clock.start_thread(work, "early-ends")
        self._loop = loop
        self._unsubscribe = [loop.subscribe(self.note, modes_only=True)]

    def note(self, tick: Tick) -> None:
        """Process a tick, on the loop's thread."""
        is_on, now_s = tick.decision.mode is not Mode.STOPPED, tick.now_s
        is_recent = self._strong_s is not None and now_s - self._strong_s < _AGAIN_S
        if is_on and not self._is_marked and not is_recent:
            self._mark(True)
        elif self._is_marked and not is_on:
            self._mark(False)
        if not self._is_marked:
            return
        if tick.sent is not Action.STOP and self._moves_s is None:
            self._moves_s = now_s
        if self._moves_s is not None and now_s - self._moves_s >= SOON_S:
            was_weak, self.count, self._strong_s = self.is_weak, 0, now_s
            self._mark(False)
            if was_weak:
                self._on_strong()

    def _mark(self, is_marked: bool) -> None:
        self._is_marked, self._moves_s = is_marked, None
        if is_marked and self._loop is not None:
            self._unsubscribe.append(self._loop.subscribe(self.note))
        elif len(self._unsubscribe) > 1:
            self._unsubscribe.pop()()
        self._wanted = is_marked
        self._due.set()

    def write(self) -> None:
        """Write the marker if it has changed; a failure is logged."""
        wanted, self._wanted = self._wanted, None
        if wanted is None:
            return
        try:
            text = json.dumps({"drive_began": wanted, "early_ends": self.count})
            write_whole(self._file, text.encode())
        except OSError as error:
            log.warning("cannot write the file that marks the start of a drive: %s", error)

    def close(self) -> None:
        """Remove the marker, so that the next run does not count this normal end as an early
        end."""
        for unsubscribe in self._unsubscribe:
            unsubscribe()
        self._ending = True
        self._due.set()
        if self._thread is not None:
            self._thread.join(timeout=1.0)
        if self._is_marked:
            self._wanted = False
        self.write()


def _read(file: Path) -> int:
    try:
        mark = json.loads(read_regular(file, 1000))
        count = mark["early_ends"]
        is_count = isinstance(count, int) and not isinstance(count, bool) and 0 <= count < 1000
        return (count if is_count else 0) + (mark["drive_began"] is True)
    except (OSError, *UNREADABLE):
        return 0
