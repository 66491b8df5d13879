"""Makes a data folder usable for a server, whatever stands in it: nothing there stops a start.

What cannot be what its name says (a pipe, a link to nowhere, a folder in place of a file, a name
that is no text) is moved to `set-aside/`, untouched; the caller says so to people.
"""

from __future__ import annotations

import errno
import os
import stat
from dataclasses import dataclass
from pathlib import Path

from robot.store.folder import is_text, write_whole

ASIDE = "set-aside"
_FOLDERS = ("models", "episodes", "exports", "trash", "journal", "lessons", "tls", ASIDE)
_FILES = (
    *(".lock", ".lock.pid", "README.txt", "robot.json", "paired.json"),
    *("models/current.txt", "models/current.twin.txt"),
)
_FULL = (errno.ENOSPC, errno.EDQUOT)
_PROBE = b"x" * 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """What was found.

    `fault` says why nothing can be kept here at all; `moved` lists what was set aside, and where.
    """

    fault: str | None = None
    moved: tuple[tuple[str, str], ...] = ()

    @property
    def sentence(self) -> str:
        """What was set aside and where, for the page and the log; empty if nothing was."""
        return ", ".join(f"{name} -> {where}" for name, where in self.moved)


def prepare(root: Path) -> Prepared:
    """Make the folder and what belongs in it, and set aside what is in the way. Never raises."""
    moved: list[tuple[str, str]] = []
    root = root.expanduser()
    try:
        if os.path.lexists(root) and not root.is_dir():
            moved.append((root.name, _move(root, root.parent)))
        root.mkdir(parents=True, exist_ok=True)
        _probe(root)
        for name in _FOLDERS:
            path = root / name
            if os.path.lexists(path) and not (path.is_dir() and os.access(path, os.R_OK | os.X_OK)):
                moved.append((name, _move(path, root / ASIDE)))
            if name not in (ASIDE, "tls", "lessons"):
                path.mkdir(exist_ok=True)
        for name in _FILES:
            path = root / name
            if os.path.lexists(path) and not _is_usable(path):
                moved.append((name, _move(path, root / ASIDE)))
        for folder in (root, *(root / name for name in _FOLDERS if name != ASIDE)):
            moved += _clear(folder, root)
    except OSError as error:
        if error.errno not in _FULL:
            return Prepared(fault=f"{root}: {error.strerror or error}", moved=tuple(moved))
    return Prepared(moved=tuple(moved))


def _clear(folder: Path, root: Path) -> list[tuple[str, str]]:
    """Set aside what is neither file nor folder, what stands for another kind, and what no text."""
    moved: list[tuple[str, str]] = []
    if folder.is_symlink():  # somebody's own folder elsewhere: not ours to tidy
        return moved
    try:
        with os.scandir(folder) as entries:
            found = list(entries)
    except OSError:
        return moved
    for entry in found:
        path = Path(entry.path)
        try:
            mode = path.stat().st_mode
            is_sound = stat.S_ISREG(mode) or stat.S_ISDIR(mode)
            if folder.name in ("episodes", "journal"):
                is_sound = stat.S_ISREG(mode)
        except OSError:
            is_sound = False
        if not is_sound or not is_text(entry.name):
            moved.append((_shown(entry.name), _move(path, root / ASIDE)))
    return moved


def _is_usable(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode) and os.access(path, os.R_OK | os.W_OK)
    except OSError:
        return False


def _move(path: Path, into: Path) -> str:
    """Move what is in the way; return where it is now, or that it stays."""
    into.mkdir(parents=True, exist_ok=True)
    shown = _shown(path.name)
    for number in range(1, 10_000):
        target = into / f"{shown}.{number}"
        if not os.path.lexists(target):
            try:
                path.rename(target)
            except OSError:
                break
            return f"{into.name}/{target.name}"
    return f"{path.parent.name}/{shown}, where it was"


def _shown(name: str) -> str:
    """Return a name as text, whatever its bytes are."""
    return name.encode("utf-8", "surrogateescape").decode("ascii", "backslashreplace")[:100]


def _probe(root: Path) -> None:
    """Raise OSError if nothing can be written here, for another reason than that it is full."""
    probe = root / ".probe"
    try:
        write_whole(probe, _PROBE)
        probe.unlink()
    except OSError as error:
        if error.errno not in _FULL:
            raise
