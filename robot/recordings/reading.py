"""Marks the recordings that are being read, so that no other program deletes them meanwhile.

A reader writes the recordings' names into a file and locks a second file next to it. The system
releases the lock when the reader's process ends for any reason. If no process holds the lock, the
names are ignored and removed.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from uuid import uuid4

from robot.errors import UNREADABLE
from robot.store.records import read_regular

_PREFIX, _LOCK, _NAMES = ".reading-", ".lock", ".json"
_MOST_BYTES = 2**24


@contextlib.contextmanager
def reading(paths: Sequence[Path]) -> Iterator[None]:
    """Prevent recordings from being deleted or rewritten. Enter and leave the context on the same
    thread."""
    with contextlib.ExitStack() as stack:
        for folder in {path.parent for path in paths}:
            names = [path.name for path in paths if path.parent == folder]
            stack.enter_context(_held(folder / f"{_PREFIX}{uuid4().hex}", names))
        yield


@contextlib.contextmanager
def _held(mark: Path, names: Sequence[str]) -> Iterator[None]:
    from filelock import FileLock

    lock = FileLock(f"{mark}{_LOCK}", timeout=0)
    told = mark.with_name(mark.name + _NAMES)
    try:
        # If the folder is read-only, no program can delete files there either.
        # Some network file systems have no locks.
        with contextlib.suppress(OSError, NotImplementedError):
            lock.acquire()
            told.write_text(json.dumps(names), encoding="ascii")
        yield
    finally:
        with contextlib.suppress(OSError):
            told.unlink(missing_ok=True)
            lock.release()
            Path(lock.lock_file).unlink(missing_ok=True)


def being_read(folder: Path) -> set[str]:
    """Return the names of a folder's files that are being read, and remove the marks of readers
    that ended."""
    from filelock import FileLock, Timeout

    names: set[str] = set()
    for told in folder.glob(f"{_PREFIX}*{_NAMES}"):
        lock = FileLock(str(told.with_suffix(_LOCK)), timeout=0)
        with contextlib.suppress(OSError, NotImplementedError):
            try:
                with lock:
                    told.unlink(missing_ok=True)
                Path(lock.lock_file).unlink(missing_ok=True)
            except Timeout:
                with contextlib.suppress(*UNREADABLE):
                    names.update(map(str, json.loads(read_regular(told, _MOST_BYTES))))
    return names
