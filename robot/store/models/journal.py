"""The journal: every change of the learner, numbered, and written as soon as it is made.

What is written survives a kill; a power cut costs at most what came since the last `fsync`, five of
which are made in a second, on the disk's thread: a disk that takes its time holds up no write.

It is the source of truth (a write-ahead log); a model's file is a cache of it. Entries are numbered
by the start of the program (a counter in the files' names) and the count of changes since; no clock
is involved.

    journal/000007-02.a     second part of the seventh start, and its twin 000007-02.b

Each part is two files of the same records (robot/store/records.py) and begins with a checkpoint,
which holds the whole learner: after every undo, whenever another model is loaded, and where the
part before has grown long. So replay learns only what the last part has; the one before it stays,
too. Loop thread: `note`. Disk's thread: `sync`. Everything else: the journal's own thread.
"""

from __future__ import annotations

import contextlib
import json
import logging
import re
import secrets
import shutil
import threading
import zlib
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from robot.clock import Clock, RealClock
from robot.control.state import Tick
from robot.policy.history import Edited, HistoryEvent, Taught, TrainingHistory
from robot.store.disk import Announce, DiskThread, no_announcement
from robot.store.folder import paths_in
from robot.store.models.events import describe_event, to_json
from robot.store.models.model import JournalPosition, Model, encode_model, take_model
from robot.store.presence import require_present
from robot.store.records import RecordWriter, open_new

log = logging.getLogger(__name__)

PART_BYTES = 4 * 2**20
"""Bytes behind its checkpoint at which a part ends, so that replay stays short."""
_LONGEST_WAIT_S = 2.0
_MOST_WAITING = 8192
_TRY_AGAIN_S = 5.0
_KEPT_PARTS = 2
_SPARE_BYTES = 8 * 2**20
_PART = re.compile(r"(\d{6,12})-(\d{2,9})\.([ab])", re.ASCII)
HEAD = b"\n"


_Record = tuple[dict[str, Any], HistoryEvent | Model | None]
"""A record to be. Its head has a `change`, and a `kind`: `event`; `checkpoint`, with the model's
`name`; `saved`, as everything up to this change is in a model's file; or `drive`, as a drive began
after this change, and some learners look for their place then."""


def list_parts(folder: Path) -> list[Part]:
    """List the parts that have a file, oldest first; none if the folder cannot be read."""
    found = [_PART.fullmatch(path.name) for path in paths_in(folder)]
    return sorted({Part(int(match[1]), int(match[2])) for match in found if match is not None})


class Part(NamedTuple):
    """One part of the journal: the number of the start, and of the part."""

    boot: int
    number: int

    def files(self, folder: Path) -> list[Path]:
        stem = f"{self.boot:06d}-{self.number:02d}"
        return [folder / f"{stem}.a", folder / f"{stem}.b"]


class Journal:
    """Writes the journal of one start; `announce` is called once when it cannot be any more."""

    def __init__(
        self,
        folder: Path,
        announce: Announce = no_announcement,
        open_file: Callable[[Path], BinaryIO] = open_new,
        clock: Clock | None = None,
    ) -> None:
        self.run = secrets.token_hex(8)
        self.boot = 0
        self._folder = folder
        self._announce = announce
        self._open_file = open_file
        self._clock = clock or RealClock()
        self._lock = threading.Lock()
        self._queue: deque[_Record] = deque()
        self._thread = DiskThread(self._clock, "journal", every_s=None)
        self._thread.add(self.write_waiting)
        self._writer: RecordWriter | None = None
        self._written = 0
        self._part = 0
        self._longest_bytes = 0
        self._needs_checkpoint = True
        self._try_again_s = 0.0
        self.fault: str | None = None
        """Why nothing is written at present; None if all is well."""
        self._drives = 0

    def position(self, change: int) -> JournalPosition:
        return JournalPosition(run=self.run, boot=self.boot, change=change)

    def start(self, after: int = 0) -> None:
        """Start writing; `after` is the number of an earlier start that is known from elsewhere."""
        self.open_boot(after)
        self._thread.start()

    def open_boot(self, after: int = 0) -> None:
        """Take the next number; `write_waiting` may then be called on any one thread."""
        self.boot = max([after, *(part.boot for part in list_parts(self._folder))]) + 1

    def stop(self) -> None:
        self._thread.stop()
        self.sync()
        self._close()

    # Called on the loop's thread ---------------------------------------------------------------

    def note(self, tick: Tick, history: TrainingHistory, name: str | None, place: str = "") -> None:
        events, must = tick.history_events, self._needs_checkpoint
        drives, self._drives = self._drives, history.drives
        if drives != history.drives and not must:
            self._put("drive", history.changes - len(events))
        if must and tick.now_s < self._try_again_s:
            return
        if not events and not (must and self._try_again_s > 0.0):
            return
        if must or not all(isinstance(event, Taught | Edited) for event in events):
            self._try_again_s = tick.now_s + _TRY_AGAIN_S
            self._needs_checkpoint = False
            self._put("checkpoint", history.changes, self.copy(history, place), name=name)
            return
        first = history.changes - len(events) + 1
        for change, event in enumerate(events, start=first):
            self._put("event", change, event)

    def copy(self, history: TrainingHistory, place: str) -> Model:
        """Copy the learner as it is now, with its position; on the loop's thread."""
        position = self.position(history.changes)
        return take_model(history.policy, history.taught, place=place, position=position)

    def _put(
        self, kind: str, change: int, body: HistoryEvent | Model | None = None, **more: str | None
    ) -> None:
        with self._lock:
            if len(self._queue) >= _MOST_WAITING:
                self._queue.clear()
                self._needs_checkpoint = True
                return
            self._queue.append(({"kind": kind, "change": change, **more}, body))
        self._thread.wake()

    # Called on any thread ------------------------------------------------------------------------

    def note_saved(self, change: int) -> None:
        """Record that everything up to this change is saved: recovery does not need it."""
        self._put("saved", change)

    async def written(self, change: int) -> bool:
        """Wait until this change is written, so that no kill can lose it once it is acknowledged.

        Waits no longer than two seconds, and not where nothing can be written: False then.
        """
        until_s = self._clock.now_s() + _LONGEST_WAIT_S
        while self.boot and self._written < change and self._clock.now_s() < until_s:
            if self.fault is not None:
                return False
            await self._clock.pause(0.005)
        return bool(self.boot) and self._written >= change

    def sync(self) -> None:
        writer = self._writer
        if writer is not None:
            writer.sync()

    # On the journal's thread ----------------------------------------------------------------------

    def write_waiting(self) -> None:
        """Write what is queued. Never raises: a failure is reported, and writing is tried again."""
        with self._lock:
            records = list(self._queue)
            self._queue.clear()
        if not records:
            return
        try:
            self._write(records)
        except Exception as error:  # top of the thread: whatever it is, the robot drives on
            self._give_up(error)
        else:
            if self.fault is not None:
                log.info("the journal is written again")
                self.fault = None

    def _write(self, records: list[_Record]) -> None:
        checkpoints = [i for i, (_, body) in enumerate(records) if isinstance(body, Model)]
        if checkpoints:
            records = records[checkpoints[-1] :]  # it holds what came before it
            self._begin_part()
        if self._writer is None:
            if all(head["kind"] in ("saved", "drive") for head, _ in records):
                return  # nothing was changed in this run
            raise OSError("a part of the journal is missing")
        self._writer.write([_encode(head, body) for head, body in records])
        self._written = max(self._written, records[-1][0]["change"])
        if checkpoints:
            self._longest_bytes = self._writer.written_bytes + PART_BYTES
            self._remove_old_parts()
        elif self._writer.written_bytes > self._longest_bytes:
            self._try_again_s = 0.0  # first: the loop may look in between
            self._needs_checkpoint = True

    def _begin_part(self) -> None:
        self._close()
        require_present(self._folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(self._folder).free < _SPARE_BYTES:
            raise OSError(28, "the disk is full")
        self._part += 1
        paths = Part(self.boot, self._part).files(self._folder)
        self._writer = RecordWriter(paths, self._open_file)

    def _close(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def _remove_old_parts(self) -> None:
        for part in list_parts(self._folder)[:-_KEPT_PARTS]:
            for path in part.files(self._folder):
                with contextlib.suppress(OSError):
                    path.unlink()

    def _give_up(self, error: Exception) -> None:
        self._close()
        self._needs_checkpoint = True
        if self.fault is None:
            sentence = getattr(error, "strerror", None) or str(error) or type(error).__name__
            self.fault = str(sentence)
            log.warning("the journal is not written: %s", error)
            self._announce("model_not_saved", detail=self.fault)


def _encode(head: dict[str, Any], body: HistoryEvent | Model | None) -> bytes:
    """Return a record: a line of JSON, and what belongs to it, packed."""
    data = b""
    if isinstance(body, Model):
        data = zlib.compress(encode_model(body), 1)
    elif body is not None:
        data = zlib.compress(to_json(describe_event(body)), 1)
    return json.dumps(head).encode() + HEAD + data
