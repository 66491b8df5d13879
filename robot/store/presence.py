"""Detects that the data folder is gone, for example because a USB stick was unplugged.

The path then leads to the empty folder of the mount point, and files written there are hidden when
the stick is mounted again. So while a watched path leads to another folder, this program writes
nothing below it.
"""

from __future__ import annotations

import contextlib
import errno
import threading
import uuid
from pathlib import Path

from robot.store.records import read_regular

MARK = ".folder-id"
"""Name of the file that identifies a folder even if its disk gets a new device number."""
_watched: dict[Path, Presence] = {}
_lock = threading.Lock()


class Presence:
    """Recognises one data folder by an identifying file that it contains.

    Args:
        root: The folder. The identifying file is written into the folder if it is missing.

    Raises:
        OSError: If the identifying file can be neither read nor written.
    """

    def __init__(self, root: Path) -> None:
        self.root = root.absolute()
        self._place = _place_of(self.root)
        file = self.root / MARK
        try:
            self._mark = read_regular(file, 100)
        except FileNotFoundError:
            self._mark = f"{uuid.uuid4()}\n".encode()
            file.write_bytes(self._mark)

    def is_there(self) -> bool:
        """True while the path leads to the original folder."""
        try:
            place = _place_of(self.root)
            if place == self._place:
                return True
            if read_regular(self.root / MARK, 100) != self._mark:
                return False
        except OSError:
            return False
        self._place = place  # the folder is back, perhaps on another disk
        return True

    def watch(self) -> None:
        """Make `require_present` refuse paths below this folder while the folder is gone."""
        with _lock:
            _watched[self.root] = self

    def end_watch(self) -> None:
        with _lock:
            if _watched.get(self.root) is self:
                del _watched[self.root]


def require_present(path: Path) -> None:
    """Raise OSError if a watched folder above this path is gone; call this before writing to it."""
    with _lock:
        watched = list(_watched.values())
    for presence in watched:
        with contextlib.suppress(ValueError):
            path.absolute().relative_to(presence.root)
            if not presence.is_there():
                raise OSError(errno.ENODEV, "the data folder is gone", str(presence.root))


def _place_of(folder: Path) -> tuple[int, int]:
    status = folder.stat()
    return status.st_dev, status.st_ino
