"""Permanently deletes all data of a participant who withdraws from a study. Copies are deleted,
too."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from pathlib import Path

from robot.store.folder import Storage, composed


def erase(storage: Storage, names: Collection[str], *paths: Path) -> list[str]:
    """Permanently delete all models, recordings and exports with the given names, including their
    copies. Also delete the files at `paths`.

    Copies in the trash are deleted, too. The files at `paths` are deleted last. As long as these
    files exist, an interrupted deletion can be repeated.

    Args:
        storage: The data folder.
        names: Names without file extensions.
        *paths: Further files.

    Returns:
        The deleted paths, relative to the data folder.

    Raises:
        OSError: If a file cannot be deleted.
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
    """True if a file has one of these names; an extension, `-2` (a part) or ` (2)` may follow."""
    entry, names = composed(entry), [composed(name) for name in names]
    return any(entry == n or (entry.startswith(n) and entry[len(n)] in ".- (") for n in names)
