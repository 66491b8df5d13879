"""Files of other programs, as far as they are text or pictures, under names that nobody trusts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robot.devices.pictures import Picture, read_picture
from robot.devices.png import encode_png
from robot.errors import RecordingError, told_as
from robot.policy.image import to_rgb
from robot.store.records import read_regular
from robot.types import Encoding, Frame

_MOST_TEXT_BYTES, _MOST_PICTURE_BYTES = 64 * 2**20, 32 * 2**20


def files_ending(folder: Path, suffix: str) -> list[Path]:
    """List a folder's files with this ending, also in capitals, in the order of their names; none
    of those that macOS lays beside them (`._NAME`)."""
    found = (path for path in folder.iterdir() if path.suffix.lower() == suffix)
    return sorted(path for path in found if path.is_file() and not path.name.startswith("."))


def read_text(path: Path) -> str:
    """Read a file; bytes that are no UTF-8 become question marks. RecordingError if it cannot be
    read, or is larger than 64 MB."""
    with told_as(RecordingError, f"{path} cannot be read", OSError, ValueError):
        is_too_large = path.stat().st_size > _MOST_TEXT_BYTES
        text = "" if is_too_large else path.read_text("utf-8-sig", errors="replace")
    if is_too_large:
        raise RecordingError(f"{path} is too large")
    return text


def parse(text: str) -> Any:
    """Return what a text says as JSON; None if it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def read_picture_file(folder: Path, name: str) -> Picture:
    """Read a picture of a folder, by an untrusted name; RecordingError if the name leads out of the
    folder, there is no such file, or it is no picture of a sensible size."""
    wrong = f"the picture {name[:80]!r} cannot be read"
    # RuntimeError is that of a loop of links.
    with told_as(RecordingError, wrong, OSError, RuntimeError, ValueError):
        path = (folder / name.replace("\\", "/")).resolve()  # tables are written on Windows, too
        if not path.is_relative_to(folder.resolve()):
            raise ValueError(f"it leads out of the folder {folder}")
        data = read_regular(path, _MOST_PICTURE_BYTES)
    return read_picture(data, repr(name[:80]))


def write_picture(frame: Frame, folder: Path, stem: str) -> str:
    """Write a frame as a file, without loss, and return its name: `.jpg` as it was, else `.png`."""
    folder.mkdir(parents=True, exist_ok=True)
    is_jpeg = frame.encoding is Encoding.JPEG
    name = f"{stem}.jpg" if is_jpeg else f"{stem}.png"
    data = frame.data if is_jpeg else encode_png(to_rgb(frame), level=3)
    (folder / name).write_bytes(data)
    return name
