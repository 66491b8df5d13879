"""Creates one file from many recordings, or from all parts of one recording, while the file is
sent. Only one block of the file is in memory at a time."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, cast

from robot.recordings.copying import copy_recording
from robot.recordings.editing import write_edited
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode
from robot.recordings.parts import files_of, part_paths

_BLOCK_BYTES = 1 << 20


class _Sink(io.RawIOBase):
    """A file for writing that buffers its bytes until `fetch`; it cannot be read or seeked."""

    def __init__(self) -> None:
        self._waiting, self._fetched = bytearray(), 0

    def tell(self) -> int:
        return self._fetched + len(self._waiting)

    def close(self) -> None:
        """Do nothing. The writer of this file closes it, but its bytes must stay readable after
        that."""

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]
        self._waiting += data
        return len(data)

    def fetch(self) -> bytes:
        data = bytes(self._waiting)
        self._waiting.clear()
        self._fetched += len(data)
        return data


class BlockWriter(_Sink):
    """A file for writing that passes its bytes to `tell` in blocks of 1 MB; `end` passes the last
    bytes."""

    def __init__(self, tell: Callable[[bytes], None]) -> None:
        super().__init__()
        self._tell = tell

    def write(self, data: bytes) -> int:  # type: ignore[override]
        super().write(data)
        if len(self._waiting) >= _BLOCK_BYTES:
            self._tell(self.fetch())
        return len(data)

    def end(self) -> None:
        self._tell(self.fetch())


def join_recording(tell: Callable[[bytes], None], path: Path) -> None:
    """Pass all files of a recording as one MCAP file to `tell`, block by block."""
    file, episode = BlockWriter(tell), open_episode(path)
    for _ in copy_recording(episode, cast(BinaryIO, file), episode.run):
        pass
    file.end()


def copy_edited(tell: Callable[[bytes], None], path: Path, notes: Notes, is_part: bool) -> None:
    """Pass the edited recording to `tell`, block by block, as `write_edited` would write it to a
    file."""
    file = BlockWriter(tell)
    write_edited(open_episode(path), notes, cast(BinaryIO, file), is_part=is_part)
    file.end()


def zip_recordings(paths: Sequence[Path]) -> Iterator[bytes]:
    """Yield a zip file of recordings with their edits, block by block.

    Recordings are stored uncompressed, since their pictures are already compressed. A recording in
    progress is included up to its current end. Raises OSError if a recording cannot be read. A
    program that downloads the zip file then notices that the file is truncated.
    """
    sink = _Sink()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_STORED) as archive:
        for path in paths:
            files = list(part_paths(path).values())
            if (notes := files_of(path)[1]).exists():
                files.append(notes)
            for file in files:
                yield from _add(archive, sink, file, file.relative_to(path.parent).as_posix())
    yield sink.fetch()


def _add(archive: zipfile.ZipFile, sink: _Sink, path: Path, name: str) -> Iterator[bytes]:
    entry = zipfile.ZipInfo.from_file(path, name, strict_timestamps=False)
    left = entry.file_size
    with path.open("rb") as source, archive.open(entry, "w", force_zip64=True) as target:
        while left > 0 and (block := source.read(min(left, _BLOCK_BYTES))):
            target.write(block)
            left -= len(block)
            yield sink.fetch()
