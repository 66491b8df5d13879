"""Finds the drives that can be imported at a path: a file, a folder, or its subfolders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from robot.errors import RecordingError
from robot.exchange.archives import unpacked
from robot.exchange.files import files_ending, folders_in
from robot.exchange.forms import FORMS, UNUSABLE, Source

_DEEPEST = 5
_FILES = (".npz", ".mcap", ".bag", ".db3")
"""Suffixes of files that contain a whole drive each, so a folder may contain several drives."""
_MOST_LOOKED_AT = 5000

__all__ = ["Source", "find_drives", "unpacked"]


def find_drives(path: Path) -> list[Source]:
    """Return the drives at a path, or in its subfolders.

    Raises RecordingError if a dataset has no readable description, or if there is no drive. If
    there is no drive, the error names the kinds of files found, and why they cannot be imported.
    """
    if not path.exists():
        raise RecordingError(f"{path} does not exist")
    found = _within(path, _DEEPEST)
    if not found:
        raise RecordingError(f"{path} {_why_none(path)}")
    return found


def _within(path: Path, depth: int) -> list[Source]:
    found = _at(path, is_whole=True)
    if found or not path.is_dir():
        return found
    for file in files_ending(path, *_FILES):
        found += _at(file, is_whole=True)
    if not found and (classes := _at(path, is_whole=False)):
        return classes
    for each in folders_in(path) if depth else ():
        found += _within(each, depth - 1)
    return found


def _at(path: Path, *, is_whole: bool) -> list[Source]:
    """Return the recorded drives at a path, from the first format that recognises the path."""
    for form in FORMS:
        if form.is_whole is is_whole and (found := form.find(path)):
            return list(found)
    return []


def _why_none(path: Path) -> str:
    """Return the reason why nothing at a path can be imported, for an error message that begins
    with the path. The reason lists kinds of files that were found."""
    names = list(islice(_names(path), _MOST_LOOKED_AT))
    for endings, why in UNUSABLE.items():
        if those := [name for name in names if name.lower().endswith(endings)]:
            more = f" and {len(those) - 1} more" if len(those) > 1 else ""
            return f"cannot be imported: {those[0]!r}{more}: {why}"
    kinds = Counter(Path(name).suffix.lower() or "without suffix" for name in names)
    told = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common(5))
    there = f"none of its files ({told}) has a known format" if names else "it is empty"
    known = ", ".join(form.name for form in FORMS)
    return f"cannot be imported: {there}; links to folders are not followed; known formats: {known}"


def _names(path: Path) -> Iterator[str]:
    if path.is_file():
        yield path.name
        return
    for each in sorted(path.rglob("*")):
        within = each.relative_to(path).as_posix()
        if each.is_file() and not each.name.startswith("."):
            yield within
