"""Entry points of the installed packages, read once because reading all packages takes 10 ms."""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import EntryPoint
from importlib.metadata import entry_points as read_entry_points
from typing import Any

EXTENSIONS = "drivelesson.services"
"""Group of the extensions of a robot's server."""


def points(group: str) -> list[EntryPoint]:
    """Return the entry points of a group, sorted by name."""
    return sorted(_all(tuple(sys.path)).select(group=group), key=lambda point: point.name)


@cache
def _all(path: tuple[str, ...]) -> Any:  # the type differs on older Pythons
    """Read all entry points; they are read again only if the search path has changed."""
    return read_entry_points()
