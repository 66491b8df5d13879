"""Completes each truncated recording once, at the next start of the program.

The complete records are copied to a new file with a valid end, which replaces the recording. Files
that are damaged in another way stay as they are.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from robot.clock import Clock
from robot.errors import UNREADABLE, RecordingError
from robot.recordings.episode import check_run, open_episode
from robot.recordings.marks import Tally
from robot.recordings.messages import PART, RUN, SUMMARY
from robot.recordings.parts import part_paths
from robot.recordings.reader import CUT_SHORT, Cut, Metadata, has_end, scan
from robot.recordings.writer import EpisodeWriter
from robot.store.folder import whole_file

log = logging.getLogger(__name__)

_MOST_LOST_BYTES = 16 * 2**20
"""Maximum number of bytes after the last complete record of a truncated file. A truncated file ends
with at most a part of one record. If there are more bytes, the file is damaged in another way."""
_SPARE_BYTES = 64 * 2**20
_RECORDS_AT_ONCE = 32
_REST_S = 0.003
"""Pause between two groups of copied records, in seconds. Without pauses, the 300,000 records of an
hour would slow a robot that drives on the same processor."""


def end_cut_recordings(paths: Sequence[Path], clock: Clock) -> None:
    """Complete the truncated recordings among `paths`, a few records at a time; never raises."""
    for path in paths:
        try:
            if end_recording(path, lambda: clock.sleep(_REST_S)):
                log.info("the recording %s was truncated; it is complete now", path.name)
        except OSError as error:
            log.warning("the truncated recording %s was not completed: %s", path.name, error)


def end_recording(path: Path, rest: Callable[[], None] = lambda: None) -> bool:
    """Complete the truncated files of one recording. Return True if a file was completed. Raises
    OSError."""
    files = part_paths(path)
    ended = [_end_file(file, files.get(number - 1), rest) for number, file in files.items()]
    return any(ended)


def _end_file(path: Path, earlier: Path | None, rest: Callable[[], None]) -> bool:
    """Complete one file of a recording; `earlier` is the file before it."""
    if not path.is_file() or path.is_symlink():
        return False
    status = path.stat()
    if has_end(path):
        return False
    if shutil.disk_usage(path.parent).free < status.st_size + _SPARE_BYTES:
        raise OSError(errno.ENOSPC, "the disk has no room for a copy")
    try:
        with whole_file(path) as copy:
            _copy_what_is_left(path, earlier, copy, rest)
            if not os.path.samestat(status, path.stat()):
                raise OSError("another program changed the file")
    except UNREADABLE:
        return False
    return True


def _copy_what_is_left(
    path: Path, earlier: Path | None, copy: BinaryIO, rest: Callable[[], None]
) -> None:
    """Copy the complete records of a truncated file. Raises one of the errors in `UNREADABLE` if
    the file is damaged in another way."""
    writer, cut, summary = None, Cut(reason="", lost_bytes=0), {"damage": CUT_SHORT}
    for number, record in enumerate(scan(path), 1):
        if number % _RECORDS_AT_ONCE == 0:
            rest()
        if isinstance(record, Cut):
            cut = record
        elif isinstance(record, Metadata) and record.name == SUMMARY:
            # if the file ends inside its summary, nothing is lost: the summary only repeats other
            # records
            summary = record.values
        elif isinstance(record, Metadata) and record.name == RUN:
            run = check_run(record.values)
            writer = EpisodeWriter(copy, run, tally=_tally_before(run, earlier))
        elif writer is None:
            raise RecordingError("the recording was made by another program")
        else:
            writer.write_copy(record)
    if writer is None or cut.lost_bytes is None or cut.lost_bytes > _MOST_LOST_BYTES:
        raise RecordingError(cut.reason)
    writer.close(summary)


def _tally_before(run: Mapping[str, str], earlier: Path | None) -> Tally:
    """Return the counts of a recording up to the beginning of one of its files. `run` is the
    metadata of that file, and `earlier` is the path of the file before it."""
    tally = Tally(json.loads(run[PART]) if PART in run else None)
    if PART in run and earlier is not None:
        with contextlib.suppress(*UNREADABLE, OSError):
            tally.note_earlier(event for _, event in open_episode(earlier).events)
    return tally
