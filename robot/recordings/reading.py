"""Tells other programs which recordings are being read, so that none is deleted meanwhile.

A reader writes their names into a file and locks another beside it. The system releases the lock
when the reader ends in any way; names without a lock no longer count.
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
    """Keep recordings from being deleted or rewritten; enter and leave it on the same thread."""
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
        # A folder that cannot be written is one in which nobody can delete, either; some file
        # systems in the network cannot lock.
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
    """Return the names of the files in a folder that are being read; forget readers that ended."""
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
