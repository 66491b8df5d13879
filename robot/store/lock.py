"""A lock that allows only one program at a time to write to a data folder."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError, InUseError, reason
from robot.types import StartStop

_NO_LOCKS = errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP


class FolderLock(StartStop):
    """Locks a folder for this process. When the process ends, the system releases the lock.

    Start and stop the lock on the same thread, and keep a reference to it, because garbage
    collection releases the lock.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._holder = folder / ".lock.pid"  # the process's id, which filelock does not store
        self._lock: Any = None

    def start(self) -> None:
        """Lock the folder. Errors name the fault, or the process that holds the lock."""
        if self._lock is not None:
            return
        from filelock import FileLock, Timeout

        lock = FileLock(str(self._folder / ".lock"), timeout=0)
        try:
            if not self._folder.is_dir():  # filelock would create the folder
                raise FileNotFoundError("no such folder")
            lock.acquire()
        except Timeout as error:
            raise InUseError(
                f"another drivelesson (process {self._read_holder()}) uses the data folder "
                f"{self._folder}; stop it, or choose another folder with --data FOLDER"
            ) from error
        except NotImplementedError:
            return  # some network file systems do not support locks
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return
            raise ConfigurationError(
                f"the data folder {self._folder} cannot be written: {reason(error)}; "
                "choose another with --data FOLDER"
            ) from error
        with contextlib.suppress(OSError):  # a full disk must not prevent the start
            self._holder.write_text(f"{os.getpid()}\n", encoding="ascii")
        self._lock = lock

    def stop(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            with contextlib.suppress(OSError):
                self._holder.unlink(missing_ok=True)
            lock.release()

    def _read_holder(self) -> str:
        with contextlib.suppress(OSError):
            text = self._holder.read_text(encoding="ascii", errors="replace").strip()
            if text.isdecimal():
                return text
        return "unknown"
