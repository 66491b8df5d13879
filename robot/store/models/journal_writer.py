"""Writes the journal in parts. Each part consists of two files with the same records.

    journal/000007-02.a, journal/000007-02.b     second part of the seventh start

A part begins with a checkpoint, which contains the complete learner. A new part begins after every
undo, whenever another model is loaded, and when the previous part has become long. So recovery only
has to relearn the examples after the last checkpoint. The last two parts are kept. The format of
the records is described in `robot/store/records.py`.
"""

from __future__ import annotations

import contextlib
import json
import logging
import re
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from robot.clock import Clock, RealClock
from robot.errors import reason
from robot.policy.events import HistoryEvent, describe_event, to_json
from robot.store.disk import Announce, DiskThread, no_announcement
from robot.store.folder import paths_in
from robot.store.models.journal import Journal, Record
from robot.store.models.model import Model, encode_model
from robot.store.presence import require_present
from robot.store.records import RecordWriter, open_new

log = logging.getLogger(__name__)

PART_BYTES = 4 * 2**20
"""A part ends once its checkpoint is followed by this many bytes, so that replay stays short."""
_LONGEST_WAIT_S = 2.0
_KEPT_PARTS = 2
_SPARE_BYTES = 8 * 2**20
_PART = re.compile(r"(\d{6,12})-(\d{2,9})\.([ab])", re.ASCII)
HEAD = b"\n"


def list_parts(folder: Path) -> list[Part]:
    """List the parts that have a file, oldest first; empty if the folder cannot be read."""
    found = [_PART.fullmatch(path.name) for path in paths_in(folder)]
    return sorted({Part(int(match[1]), int(match[2])) for match in found if match is not None})


class Part(NamedTuple):
    """One part of the journal: the number of the program's start, and the number of the part."""

    boot: int
    number: int

    def files(self, folder: Path) -> list[Path]:
        stem = f"{self.boot:06d}-{self.number:02d}"
        return [folder / f"{stem}.a", folder / f"{stem}.b"]


class JournalWriter:
    """Writes what a journal queues; `announce` is called once when writing fails.

    `sync` runs on the disk's thread, and `write_waiting` on the journal's.
    """

    def __init__(
        self,
        journal: Journal,
        folder: Path,
        announce: Announce = no_announcement,
        open_file: Callable[[Path], BinaryIO] = open_new,
        clock: Clock | None = None,
    ) -> None:
        self.fault: str | None = None
        """The reason why the journal cannot be written now; None if it can be written."""
        self._journal, self._folder = journal, folder
        self._announce = announce
        self._open_file = open_file
        self._clock = clock or RealClock()
        self._thread = DiskThread(self._clock, "journal", every_s=None)
        self._thread.add(self.write_waiting)
        journal.wake = self._thread.wake
        self._writer: RecordWriter | None = None
        self._written = 0
        self._part = 0
        self._longest_bytes = 0

    def start(self, after: int = 0) -> None:
        """Start writing. `after` is the number of the program start that saved the model in use;
        the present start gets a higher number."""
        self.open_boot(after)
        self._thread.start()

    def open_boot(self, after: int = 0) -> None:
        """Choose the number of this program start; one thread may then call `write_waiting`."""
        self._journal.boot = max([after, *(part.boot for part in list_parts(self._folder))]) + 1

    def stop(self) -> None:
        self._thread.stop()
        self.sync()
        self._close()

    async def written(self, change: int) -> bool:
        """Wait until change number `change` is written, before the server acknowledges it.

        Waits at most two seconds. Returns False if the change is not written within this time, or
        cannot be written at all.
        """
        until_s = self._clock.now_s() + _LONGEST_WAIT_S
        while self._journal.boot and self._written < change and self._clock.now_s() < until_s:
            if self.fault is not None:
                return False
            await self._clock.pause(0.005)
        return bool(self._journal.boot) and self._written >= change

    def sync(self) -> None:
        writer = self._writer
        if writer is not None:
            writer.sync()

    def write_waiting(self) -> None:
        """Write the queued records. Never raises: a failure is reported, and writing is retried."""
        records = self._journal.take()
        if not records:
            return
        try:
            self._write(records)
        except Exception as error:  # outermost handler: the robot drives on after any error
            self._give_up(error)
        else:
            if self.fault is not None:
                log.info("the journal can be written again")
                self.fault = None

    def _write(self, records: list[Record]) -> None:
        checkpoints = [i for i, (_, body) in enumerate(records) if isinstance(body, Model)]
        if checkpoints:
            records = records[checkpoints[-1] :]  # this checkpoint contains all earlier changes
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
            self._journal.require_checkpoint(has_failed=False)

    def _begin_part(self) -> None:
        self._close()
        require_present(self._folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(self._folder).free < _SPARE_BYTES:
            raise OSError(28, "the disk is full")
        self._part += 1
        paths = Part(self._journal.boot, self._part).files(self._folder)
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
        self._journal.require_checkpoint(has_failed=True)
        if self.fault is None:
            self.fault = reason(error)
            log.warning("cannot write the journal: %s", error)
            self._announce("model_not_saved", detail=self.fault)


def _encode(head: dict[str, Any], body: HistoryEvent | Model | None) -> bytes:
    """Return a record as bytes: the head as a line of JSON, and the body, compressed."""
    data = b""
    if isinstance(body, Model):
        data = zlib.compress(encode_model(body), 1)
    elif body is not None:
        data = zlib.compress(to_json(describe_event(body)), 1)
    return json.dumps(head).encode() + HEAD + data
