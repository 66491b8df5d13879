"""A disk below one folder that can fail, fill up or kill the process."""

from __future__ import annotations

import errno
import io
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Disk:
    """Counts the calls that change a folder; one of them, or all from it on, can fail or kill.

    Attributes:
        is_failing: True while calls may fail; the robot must then say what is not saved.
        calls: Number of calls since `fail` or `kill` was called.
    """

    def __init__(self, root: Path) -> None:
        self._root = os.fspath(root)
        self._left = self.calls = 0
        self._do: Callable[[str], None] | None = None
        self._lasts = False
        self.is_failing = False

    def fail(self, after: int, *, lasts: bool, why: int = errno.EIO) -> None:
        """Fail the call after this number of calls, or all calls from it on until `heal`."""

        def refuse(path: str) -> None:
            raise OSError(why, os.strerror(why), path)

        self.calls = 0
        self._left, self._do, self._lasts, self.is_failing = after, refuse, lasts, True

    def kill(self, after: int) -> None:
        """Kill this process before the call after this number of calls."""
        self._left, self._lasts = after, True
        self._do = lambda path: os.kill(os.getpid(), signal.SIGKILL)

    def heal(self) -> None:
        self._do, self.is_failing = None, False

    def count(self, path: Any) -> None:
        if self._do is None or not os.fspath(path).startswith(self._root):
            return
        self._left -= 1
        self.calls += 1
        if self._left < 0:
            do = self._do
            if not self._lasts:
                self._do = lambda path: None
            do(os.fspath(path))

    def install(self, put: Callable[[Any, str, Any], None] = setattr) -> None:
        """Intercept the program's calls on its folder, for the rest of the process or as long as
        `put` runs."""

        def counted(module: Any, name: str, writes: Callable[..., bool] = lambda *_: True) -> None:
            real = getattr(module, name)

            def call(path: Any, *args: Any, **named: Any) -> Any:
                is_there = name == "mkdir" and Path(path).is_dir()  # nothing changes
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

    def lay_beneath(self, files: list[Any]) -> list[Any]:
        """Return the files that are open already, whose writes are also counted."""
        disk = self

        class File:
            def __init__(self, file: Any) -> None:
                self._file = file

            def write(self, data: bytes) -> int:
                disk.count(disk._root)
                return int(self._file.write(data))

            def __getattr__(self, name: str) -> Any:
                return getattr(self._file, name)

        return [File(file) for file in files]
