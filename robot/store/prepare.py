"""Makes a data folder usable for a server, so that no unexpected file prevents a start.

Entries of a wrong kind are moved to `set-aside/` unchanged: for example a pipe, a dangling link, a
folder in place of a file, or a file whose name is not UTF-8. The caller reports them.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Callable
from pathlib import Path

from robot.store.folder import folder_kinds, is_text, move_aside

ASIDE = "set-aside"
_FOLDERS = ("models", "exports", "trash", "journal")
_FILES = (".lock", ".lock.pid", "README.txt", "robot.json")
_JOURNAL = re.compile(r"\d+-\d+\.[ab]", re.ASCII)
_NOTES = ("models/current.txt", "models/current.twin.txt")


def prepare(root: Path) -> list[tuple[str, str]]:
    """Set aside entries that `Storage` cannot use; return their old and new paths. Never raises."""
    moved: list[tuple[str, str]] = []
    root = root.expanduser()

    def clear(path: Path, is_usable: bool, into: Path = root / ASIDE) -> None:
        if os.path.lexists(path) and not is_usable:
            moved.append((_shown(path.name), _move(path, into)))

    with contextlib.suppress(OSError):
        clear(root, root.is_dir(), root.parent)
        kinds = folder_kinds()
        folders = [root / name for name in (*_FOLDERS, *(kind.name for kind in kinds))]
        own_files = [name for kind in kinds for name in kind.files]
        read = {"journal": _JOURNAL} | {kind.name: kind.reads for kind in kinds if kind.reads}
        clear(root / ASIDE, (root / ASIDE).is_dir(), root)
        for folder in folders:
            clear(folder, folder.is_dir() and os.access(folder, os.R_OK | os.X_OK))
        for file in (root / name for name in (*_FILES, *own_files, *_NOTES)):
            clear(file, _is_a(file, stat.S_ISREG) and os.access(file, os.R_OK | os.W_OK))
        for inside, names in read.items():
            for path in (p for top in _found_in(root / inside) for p in (top, *_found_in(top))):
                name = path.relative_to(root / inside).as_posix()
                for end, kind in (("", stat.S_ISREG), ("/", stat.S_ISDIR)):
                    if names.fullmatch(name + end):
                        clear(path, _is_a(path, kind) and is_text(path.name))
    return moved


def _found_in(folder: Path) -> list[Path]:
    """List a folder's entries; empty for a link, because its target is not in the data folder."""
    try:
        return [] if folder.is_symlink() else list(folder.iterdir())
    except OSError:
        return []


def _is_a(path: Path, kind: Callable[[int], bool]) -> bool:
    try:
        return kind(path.stat().st_mode)
    except OSError:
        return False


def _move(path: Path, into: Path) -> str:
    """Move an entry; return its new path, or a text that says that it was not moved."""
    into.mkdir(parents=True, exist_ok=True)
    shown = _shown(path.name)
    found = move_aside(path, (into / f"{shown}.{number}" for number in range(1, 10_000)))
    stays = f"{path.parent.name}/{shown}, where it was"
    return stays if found == path else f"{into.name}/{found.name}"


def _shown(name: str) -> str:
    return name.encode("utf-8", "surrogateescape").decode("ascii", "backslashreplace")[:100]
