"""Reads text and picture files of other programs. The names of the files are untrusted."""

from __future__ import annotations

import codecs
import io
import json
import os
import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from robot.devices.encoders import encode_png
from robot.devkit.pictures import Picture, read_picture
from robot.errors import ConfigurationError, RecordingError, told_as
from robot.policy.image import to_rgb
from robot.store.folder import fold
from robot.store.records import read_regular
from robot.types import Encoding, Frame

_MOST_TEXT_BYTES, _MOST_PICTURE_BYTES = 64 * 2**20, 32 * 2**20
_HEAD_BYTES = 256 * 2**10
_INVALID = "\N{REPLACEMENT CHARACTER}"
_UTF_16 = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE
PICTURES = (".jpg", ".jpeg", ".png")
"""Suffixes of readable pictures, in lower case."""
_MOST_PICTURES = 2_000_000
_OPENS_NO_LINK, _SIGNS_OF_PATHS = hasattr(os, "O_NOFOLLOW"), "/\\:"


def files_ending(folder: Path, *suffixes: str) -> list[Path]:
    """List a folder's files with these suffixes (in upper or lower case), sorted by name. The files
    that macOS adds (`._NAME`) are left out."""
    found = (path for path in folder.iterdir() if path.suffix.lower() in suffixes)
    return sorted(path for path in found if path.is_file() and not path.name.startswith("."))


def check_suffix(path: Path, what: str, suffixes: Sequence[str]) -> None:
    """Raise ConfigurationError for unsupported suffixes; the error lists the supported ones."""
    if path.suffix.lower() not in suffixes:
        raise ConfigurationError(
            f"{what}'s name must end in {' or '.join(suffixes)}, not in {path.suffix!r}: {path}"
        )


def folders_in(folder: Path) -> list[Path]:
    """List a folder's subfolders, sorted by name. Links and special folders (`.git`, `_old`,
    `__MACOSX`) are left out."""
    found = (each for each in folder.iterdir() if each.name[0] not in "._")
    return sorted(each for each in found if each.is_dir() and not each.is_symlink())


def by_number(paths: Iterable[Path]) -> list[Path]:
    """Sort files in natural order: `2.jpg` before `10.jpg`."""

    def key(path: Path) -> list[tuple[int, int, str]]:
        parts = re.split(r"(\d{1,18})", path.name.casefold())
        return [(0, int(p), "") if p.isdecimal() else (1, 0, p) for p in parts]

    return sorted(paths, key=key)


def read_text(path: Path) -> str:
    """Read a text file in UTF-8, in UTF-16 if it begins with a byte order mark, or in Windows-1252.
    Invalid characters become replacement characters. Raises RecordingError if the file cannot be
    read or is larger than 64 MB."""
    with told_as(RecordingError, f"{path} cannot be read", OSError, ValueError):
        is_too_large = path.stat().st_size > _MOST_TEXT_BYTES
        data = b"" if is_too_large else path.read_bytes()
    if is_too_large:
        raise RecordingError(f"{path} is too large")
    return _decoded(data).replace("\r\n", "\n").replace("\r", "\n")


def _decoded(data: bytes) -> str:
    # Excel's "Unicode Text" and the output that PowerShell redirects are in UTF-16
    encoding = "utf-16" if data.startswith(_UTF_16) else "utf-8-sig"
    text = data.decode(encoding, errors="replace")
    # Excel saves "CSV" in Windows-1252. Such text is hardly ever valid UTF-8.
    # Truncated or damaged UTF-8 still has more valid characters than invalid ones.
    n_invalid = text.count(_INVALID)
    if n_invalid and 2 * n_invalid > sum(sign > "\x7f" for sign in text):
        return data.decode("cp1252", errors="replace")
    return text


def read_head(path: Path) -> str:
    """Read whole lines from the start of a text file, up to 256 kB; errors as in `read_text`."""
    with (
        told_as(RecordingError, f"{path} cannot be read", OSError, ValueError),
        path.open("rb") as file,
    ):
        data = file.read(_HEAD_BYTES)
    text = _decoded(data)
    return text if len(data) < _HEAD_BYTES else text[: text.rfind("\n") + 1] or text


def parse(text: str) -> Any:
    """Return the value of a JSON text; None if the text is not JSON."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def read_picture_file(folder: Path, name: str) -> Picture:
    """Read the picture with this untrusted name from a folder. Raises RecordingError if the name
    leads out of the folder, or if the file cannot be read as a picture."""
    return read_picture(_read_plain(folder, name) or _read_resolved(folder, name), "the picture")


def _read_plain(folder: Path, name: str) -> bytes | None:
    """Read a file of this folder. Return None for a path with a subfolder, for a link, and for a
    file that cannot be read. The function takes a fifth of the time of `_read_resolved`."""
    if not _OPENS_NO_LINK or any(sign in name for sign in _SIGNS_OF_PATHS):
        return None
    try:
        return read_regular(f"{folder}{os.sep}{name}", _MOST_PICTURE_BYTES)
    except (OSError, ValueError):
        return None


def _read_resolved(folder: Path, name: str) -> bytes:
    # Resolving a loop of symbolic links raises RuntimeError.
    with told_as(RecordingError, "the picture cannot be read", OSError, RuntimeError, ValueError):
        path = (folder / name.replace("\\", "/")).resolve()  # a table may come from Windows
        if not path.is_relative_to(folder.resolve()):
            raise ValueError(f"the path leads out of the folder {folder}")
        try:
            return read_regular(path, _MOST_PICTURE_BYTES)
        except FileNotFoundError:
            raise RecordingError("the picture is missing") from None


class Pictures:
    """A folder's pictures. Finds the pictures by paths that another computer wrote; only the
    last parts of the paths must match."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def find(self, name: str) -> str:
        """Return a picture's path in the folder, by its name in a table.

        If there is a file with this name, its path is returned. If there is no such file, pictures
        with the same file name in other folders are considered, and the one whose folders match
        best is chosen.

        Raises:
            ValueError: If several pictures match equally well.
        """
        parts = [part for part in re.split(r"[\\/]+", name.strip()) if part != "."]
        if not parts:
            return name
        is_near = ".." not in parts and not name.startswith(("/", "\\")) and ":" not in parts[0]
        own = "/".join(parts)
        if is_near and ((self._folder / own).is_file() or (self._folder / own).is_symlink()):
            return own
        same = self._by_last.get(fold(parts[-1]), [])
        if not same:
            return own if is_near or ".." in parts else parts[-1]
        wanted = [fold(part) for part in reversed(parts)]
        agreeing = {path: _agreeing(wanted, path) for path in same}
        best = [path for path, count in agreeing.items() if count == max(agreeing.values())]
        if len(best) > 1:
            raise ValueError(f"{len(best)} pictures match the name {parts[-1][:80]!r} equally well")
        return best[0]

    def all(self) -> set[str]:
        """Return the paths of all pictures."""
        return {path for same in self._by_last.values() for path in same}

    @cached_property
    def _by_last(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for count, path in enumerate(self._folder.rglob("*")):
            if count > _MOST_PICTURES:
                raise RecordingError(f"{self._folder} has too many files")
            if path.suffix.lower() in PICTURES and not path.name.startswith("."):
                within = path.relative_to(self._folder).as_posix()
                found.setdefault(fold(path.name), []).append(within)
        return found


def _agreeing(wanted: list[str], path: str) -> int:
    """Count the matching parts of two paths, from the end."""
    there = [fold(part) for part in reversed(path.split("/"))]
    for count, (one, other) in enumerate(zip(wanted, there, strict=False)):
        if one != other:
            return count
    return min(len(wanted), len(there))


def write_picture(frame: Frame, folder: Path, stem: str) -> str:
    """Write a frame without loss, and return the file's name. A JPEG is written unchanged, other
    frames as `.png`."""
    is_jpeg = frame.encoding is Encoding.JPEG
    name = f"{stem}.jpg" if is_jpeg else f"{stem}.png"
    data = frame.data if is_jpeg else encode_png(to_rgb(frame), level=3)
    path = f"{folder}{os.sep}{name}"
    try:
        _write(path, data)
    except FileNotFoundError:  # this is the first picture, and the folder does not exist yet
        folder.mkdir(parents=True, exist_ok=True)
        _write(path, data)
    return name


def _write(path: str, data: bytes) -> None:
    """Write a file with few system calls, because an export may have 200,000 files."""
    left = memoryview(data)
    with io.FileIO(path, "w") as file:
        while left:
            left = left[file.write(left) :]
