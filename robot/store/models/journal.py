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
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from robot.clock import Clock, RealClock
from robot.control.state import Tick
from robot.policy.history import Edited, HistoryEvent, Taught, TrainingHistory
from robot.store.disk import DiskThread
from robot.store.models.events import describe_event, to_json
from robot.store.models.model import JournalPosition, Model, encode_model, take_model
from robot.store.records import RecordWriter, open_new

log = logging.getLogger(__name__)

PART_BYTES = 4 * 2**20
"""At this size a new part is begun, so that replay stays short."""
_LONGEST_WAIT_S = 2.0
_MOST_WAITING = 8192
_TRY_AGAIN_S = 5.0
_KEPT_PARTS = 2
_SPARE_BYTES = 8 * 2**20
_PART = re.compile(r"(\d{6,12})-(\d{2,9})\.([ab])", re.ASCII)
HEAD = b"\n"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Item:
    """One record to be: an `event`, a `checkpoint` that begins a part, or a word of two kinds.

    `saved`: everything up to this change is in a model's file. `drive`: a drive began after this
    change; some learners look for their place then.
    """

    kind: str
    change: int
    event: HistoryEvent | None = None
    model: Model | None = None
    name: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Part:
    """Where one part of the journal is."""

    boot: int
    number: int
    folder: Path

    @property
    def paths(self) -> tuple[Path, Path]:
        stem = f"{self.boot:06d}-{self.number:02d}"
        return self.folder / f"{stem}.a", self.folder / f"{stem}.b"


def list_parts(folder: Path) -> list[Part]:
    """List the parts that have a file, oldest first; none if the folder cannot be read."""
    try:
        found = [_PART.fullmatch(path.name) for path in folder.iterdir()]
    except OSError:
        return []
    return sorted(
        {Part(boot=int(m[1]), number=int(m[2]), folder=folder) for m in found if m is not None}
    )


class Journal:
    """Writes the journal of one start; `on_fault` is called once when it cannot be any more."""

    def __init__(
        self,
        folder: Path,
        on_fault: Callable[[str], None] = lambda sentence: None,
        open_file: Callable[[Path], BinaryIO] = open_new,
        clock: Clock | None = None,
    ) -> None:
        self.run = secrets.token_hex(8)
        self.boot = 0
        self._folder = folder
        self._on_fault = on_fault
        self._open_file = open_file
        self._clock = clock or RealClock()
        self._lock = threading.Lock()
        self._queue: deque[_Item] = deque()
        self._thread = DiskThread(self._clock, "journal", every_s=None)
        self._thread.add(self.write_waiting)
        self._writer: RecordWriter | None = None
        self._written = -1
        self._part = 0
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
        """Write what is queued, and end; idempotent."""
        self._thread.stop()
        self.sync()
        self._close()

    # Called on the loop's thread ---------------------------------------------------------------

    def note(self, tick: Tick, history: TrainingHistory, name: str | None, place: str = "") -> None:
        """Queue the changes of the learner in one tick."""
        events, must = tick.history_events, self._needs_checkpoint
        drives, self._drives = self._drives, history.drives
        if drives != history.drives and not must:
            self._put(_Item(kind="drive", change=history.changes - len(events)))
        if must and tick.now_s < self._try_again_s:
            return
        if not events and not (must and self._try_again_s > 0.0):
            return
        if must or not all(isinstance(event, Taught | Edited) for event in events):
            self._try_again_s = tick.now_s + _TRY_AGAIN_S
            self._needs_checkpoint = False
            model = self.copy(history, place)
            self._put(_Item(kind="checkpoint", change=history.changes, model=model, name=name))
            return
        first = history.changes - len(events) + 1
        for change, event in enumerate(events, start=first):
            self._put(_Item(kind="event", change=change, event=event))

    def copy(self, history: TrainingHistory, place: str) -> Model:
        """Copy the learner as it is now, with its position; on the loop's thread."""
        return take_model(
            history.policy,
            Counter(history.taught),
            saved_at_s=0.0,
            place=place,
            position=self.position(history.changes),
        )

    def _put(self, item: _Item) -> None:
        with self._lock:
            if len(self._queue) >= _MOST_WAITING:
                self._queue.clear()
                self._needs_checkpoint = True
                return
            self._queue.append(item)
        self._thread.wake()

    # Called on any thread ------------------------------------------------------------------------

    def note_saved(self, change: int) -> None:
        """Record that everything up to this change is saved: recovery does not need it."""
        self._put(_Item(kind="saved", change=change))

    async def written(self, change: int) -> None:
        """Wait until this change is written, so that no kill can lose it once it is acknowledged.

        Waits no longer than two seconds, and not where nothing can be written.
        """
        until_s = self._clock.now_s() + _LONGEST_WAIT_S
        while self.boot and self._written < change and self._clock.now_s() < until_s:
            if self.fault is not None:
                return
            await self._clock.pause(0.005)

    def sync(self) -> None:
        writer = self._writer
        if writer is not None:
            writer.sync()

    # On the journal's thread ----------------------------------------------------------------------

    def write_waiting(self) -> None:
        """Write what is queued. Never raises: a failure is reported, and writing is tried again."""
        with self._lock:
            items = list(self._queue)
            self._queue.clear()
        if not items:
            return
        try:
            self._write(items)
        except Exception as error:  # top of the thread: whatever it is, the robot drives on
            self._give_up(error)
        else:
            if self.fault is not None:
                log.info("the journal is written again")
                self.fault = None

    def _write(self, items: list[_Item]) -> None:
        checkpoints = [i for i, item in enumerate(items) if item.model is not None]
        if checkpoints:
            items = items[checkpoints[-1] :]  # it holds what came before it
            self._begin_part()
        if self._writer is None:
            if all(item.kind in ("saved", "drive") for item in items):
                return  # nothing was changed in this run
            raise OSError("a part of the journal is missing")
        self._writer.write([_encode(item) for item in items])
        self._written = max(self._written, items[-1].change)
        self._remove_old_parts()
        if self._writer.written_bytes > PART_BYTES:
            self._try_again_s = 0.0  # first: the loop may look in between
            self._needs_checkpoint = True

    def _begin_part(self) -> None:
        self._close()
        self._folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(self._folder).free < _SPARE_BYTES:
            raise OSError(28, "the disk is full")
        self._part += 1
        part = Part(boot=self.boot, number=self._part, folder=self._folder)
        self._writer = RecordWriter(part.paths, self._open_file)

    def _close(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def _remove_old_parts(self) -> None:
        for part in list_parts(self._folder)[:-_KEPT_PARTS]:
            for path in part.paths:
                with contextlib.suppress(OSError):
                    path.unlink()

    def _give_up(self, error: Exception) -> None:
        self._close()
        self._needs_checkpoint = True
        if self.fault is None:
            sentence = getattr(error, "strerror", None) or str(error) or type(error).__name__
            self.fault = str(sentence)
            log.warning("the journal is not written: %s", error)
            self._on_fault(self.fault)


def _encode(item: _Item) -> bytes:
    """Return a record: a line of JSON, and what belongs to it, packed."""
    head: dict[str, Any] = {"kind": item.kind, "change": item.change}
    body = b""
    if item.model is not None:
        head["name"] = item.name
        body = zlib.compress(encode_model(item.model), 1)
    elif item.event is not None:
        body = zlib.compress(to_json(describe_event(item.event)), 1)
    return json.dumps(head).encode() + HEAD + body
