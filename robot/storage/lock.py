"""One program at a time records into a data folder: two would sweep away each other's halves."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path

from robot.errors import ConfigurationError
from robot.lifecycle import StartStop

try:
    import fcntl
except ImportError:  # a system without it, as Windows: there nothing is locked
    fcntl = None  # type: ignore[assignment]


class FolderLock(StartStop):
    """Holds a folder for this process. The system lets go of it however the process ends."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._handle: int | None = None

    def start(self) -> None:
        """Take the folder.

        Raises:
            ConfigurationError: If another program has it (the sentence has that program's process
                number), or nothing can be written there.
        """
        if self._handle is not None or fcntl is None:
            return
        try:
            handle = os.open(self._folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise ConfigurationError(
                f"the data folder {self._folder} cannot be written: {error.strerror or error}; "
                "choose another with --data FOLDER"
            ) from error
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            holder = os.read(handle, 20).decode("ascii", "replace").strip() or "unknown"
            os.close(handle)
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                return  # a file system that cannot lock, as some in the network
            raise ConfigurationError(
                f"another drivelesson (process {holder}) keeps its lessons in {self._folder}; "
                "stop it, or choose another folder with --data FOLDER"
            ) from error
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()}\n".encode())
        self._handle = handle

    def stop(self) -> None:
        """Let go of the folder; the file stays, so that nobody locks a name that is gone."""
        handle, self._handle = self._handle, None
        if handle is not None:
            with contextlib.suppress(OSError):
                os.ftruncate(handle, 0)
            os.close(handle)
