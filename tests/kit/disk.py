"""A simulated disk below one folder, which can fail, fill up, or be inspected before each call."""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from server.persistence import Persistence


class Disk:
    """Counts the calls that change a folder; one of them, or all from a given one on, can fail.

    Attributes:
        calls: Number of calls since `fail` was called.
        before_each: A function to call before each counted call; `heal` ends this.
    """

    def __init__(self, root: Path) -> None:
        self._root = os.fspath(root)
        self._first = self.calls = 0
        self._is_watching = self._lasts = False
        self._why = errno.EIO
        self.before_each: Callable[[], object] = lambda: None

    def fail(self, after: int, *, lasts: bool, why: int = errno.EIO) -> None:
        """Fail the call after this number of calls, or all calls from it on until `heal`."""
        self._first, self._lasts, self._why = after, lasts, why
        self.calls, self._is_watching = 0, True

    def heal(self) -> None:
        self._is_watching = False

    def count(self, path: Any) -> None:
        if not self._is_watching or not os.fspath(path).startswith(self._root):
            return
        self._is_watching = False
        self.before_each()
        self._is_watching = True
        self.calls += 1
        late = self.calls - 1 - self._first
        if late == 0 or (late > 0 and self._lasts):
            raise OSError(self._why, os.strerror(self._why), os.fspath(path))

    def install(self, put: Callable[[Any, str, Any], None]) -> None:
        """Intercept the program's calls on its folder, as long as the patches by `put` last."""

        def counted(module: Any, name: str, writes: Callable[..., bool] = lambda *_: True) -> None:
            real = getattr(module, name)

            def call(path: Any, *args: Any, **named: Any) -> Any:
                is_there = name == "mkdir" and Path(path).is_dir()  # this call changes nothing
                if not isinstance(path, int) and not is_there and writes(*args, *named.values()):
                    self.count(path)
                return real(path, *args, **named)

            put(module, name, call)

        for name in ("mkdir", "rename", "replace", "unlink", "rmdir"):
            counted(os, name)
        writing = os.O_WRONLY | os.O_RDWR | os.O_CREAT
        counted(os, "open", lambda flags=0, *_: bool(flags & writing))
        counted(io, "open", lambda mode="r", *_: bool(set(str(mode)) & set("wax+")))
        real_sync = os.fsync

        def sync(handle: Any) -> None:
            self.count(self._root)
            real_sync(handle)

        put(os, "fsync", sync)

    def lay_beneath(self, persistence: Persistence) -> None:
        """Count and fail the writes to the journal's open files, too."""
        disk, writer = self, persistence.writer._writer

        class File:
            def __init__(self, file: Any) -> None:
                self._file = file

            def write(self, data: bytes) -> int:
                disk.count(disk._root)
                return int(self._file.write(data))

            def __getattr__(self, name: str) -> Any:
                return getattr(self._file, name)

        if writer is not None:
            writer._files = [File(file) for file in writer._files]
