"""The files of one recording: NAME.mcap and, if it is long, NAME.parts/1.mcap, 2.mcap and so on.

Each file is a complete MCAP file, which other programs can open. The upper bits of a chunk's offset
are the number of its file, so one number locates a chunk among all files.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from robot.errors import RecordingError
from robot.recordings.edits import notes_path
from robot.recordings.messages import CONTINUES, SUMMARY
from robot.recordings.reader import (
    CUT_SHORT,
    Block,
    Cut,
    MessageChannel,
    Part,
    Record,
    blocks_from,
    has_end,
    read_chunk,
    read_metadata,
    records_in,
    walk,
)

ENDING = ".parts"
"""Suffix of the folder that holds all files of a recording except the first."""
_BITS = 40
_FILE = re.compile(r"([1-9]\d{0,5})\.mcap", re.ASCII)


def parts_folder(path: Path) -> Path:
    return path.with_suffix(ENDING)


def part_path(path: Path, number: int) -> Path:
    """Return the path of a recording's file; the first has the number 0."""
    return parts_folder(path) / f"{number}.mcap" if number else path


def part_paths(path: Path) -> dict[int, Path]:
    """Return the paths of a recording's files by number, in ascending order. The first file, number
    0, is included even if it does not exist."""
    found: dict[int, Path] = {}
    with contextlib.suppress(OSError):
        for file in parts_folder(path).iterdir():
            if match := _FILE.fullmatch(file.name):
                found[int(match[1])] = file
    return {0: path, **dict(sorted(found.items()))}


def is_part(path: Path) -> bool:
    """True for the second and each further file of a recording whose first file exists."""
    folder = path.parent
    return bool(
        _FILE.fullmatch(path.name)
        and folder.suffix == ENDING
        and folder.with_suffix(".mcap").is_file()
    )


def files_of(path: Path) -> tuple[Path, Path, Path]:
    """Return all paths that belong to a recording: its first file, its notes and the folder of its
    parts."""
    return path, notes_path(path), parts_folder(path)


def state_of(path: Path) -> tuple[tuple[int, int], ...]:
    """Return the size and modification time of each file of a recording, to notice when the
    recording changes."""
    found = [file.stat() for file in part_paths(path).values()]
    return tuple((status.st_size, status.st_mtime_ns) for status in found)


def has_ended(path: Path) -> bool:
    """True if a recording is complete: none of its files is being written or was truncated."""
    last = list(part_paths(path).values())[-1]
    if not has_end(last):
        return False
    with contextlib.suppress(RecordingError, OSError):  # a damaged file is no longer written to
        return CONTINUES not in read_metadata(last).get(SUMMARY, {})
    return True


def base_of(number: int) -> int:
    """Return the offset at which a recording's file begins."""
    return number << _BITS


def scan_parts(path: Path) -> Iterator[Record]:
    """Yield the content of all files of a recording, in order. The content of a damaged file ends
    in a `Cut`."""
    return records_in(part for file in part_paths(path).items() for part in walk_part(*file))


def walk_part(number: int, file: Path) -> Iterator[Part]:
    """Yield the content of one file of a recording, with offsets in the recording."""
    try:
        for part in walk(file):
            if isinstance(part, Block):
                part = part._replace(offset=part.offset + base_of(number))
            yield part
    except (RecordingError, OSError):
        if number == 0:
            raise
        yield Cut(CUT_SHORT)  # the power failed while the file was being created


def blocks_after(
    path: Path, offset: int, channels: Mapping[int, Mapping[int, MessageChannel]]
) -> Iterator[Block]:
    """Yield a recording's chunks from `offset` on; `channels` are the channels of each file."""
    first = offset >> _BITS
    if offset:
        begin, own = base_of(first), channels.get(first, {})
        for block in blocks_from(part_path(path, first), offset - begin, own):
            yield block._replace(offset=block.offset + begin)
    for number, file in part_paths(path).items():
        if number > first or offset == 0:
            yield from (part for part in walk_part(number, file) if isinstance(part, Block))


def read_chunk_at(path: Path, offset: int) -> bytes:
    """Return the unpacked bytes of a recording's chunk at `offset`."""
    number = offset >> _BITS
    return read_chunk(part_path(path, number), offset - base_of(number))
