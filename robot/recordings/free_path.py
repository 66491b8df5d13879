"""Chooses the name of a new file, so that no existing file is overwritten."""

from __future__ import annotations

from itertools import chain, count
from pathlib import Path


def free_path(folder: Path, stem: str, ending: str) -> Path:
    """Return the first of `stem`, `stem-2` and so on that is not used in a folder."""
    names = chain([stem], (f"{stem}-{again}" for again in count(2)))
    return next(
        path for path in (folder / f"{name}{ending}" for name in names) if not path.exists()
    )
