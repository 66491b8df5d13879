"""Permanently deletes the data of a participant who withdraws, with all copies."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from pathlib import Path

from robot.store.folder import Storage, composed


def erase(storage: Storage, names: Collection[str], *paths: Path) -> list[str]:
    """Permanently delete the data with these names and all their copies, and the given files.

    The names are names of models, recordings and exports without file extensions. Data in the trash
    is deleted, too. The given files are deleted last, so that an interrupted deletion can be
    repeated.
    Returns the deleted paths within the data folder; raises OSError if a deletion fails.
    """
    folders = (folder for folder in (*storage.kept(), *storage.trash.iterdir()) if folder.is_dir())
    entries = [path for folder in folders for path in folder.iterdir()]
    found = [path for path in entries if _is_called(path.name.lstrip("."), names)]
    for path in (*found, *paths):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    return [path.relative_to(storage.root).as_posix() for path in (*found, *paths)]


def _is_called(entry: str, names: Collection[str]) -> bool:
    """True for a name with any file extension, also of a part (`-2`) or a copy (` (2)`)."""
    entry, names = composed(entry), [composed(name) for name in names]
    return any(entry == n or (entry.startswith(n) and entry[len(n)] in ".- (") for n in names)
