"""Creates a zip file of many recordings while it is sent; only one block is in memory."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from robot.recordings.edits import notes_path

_BLOCK_BYTES = 1 << 20


class _Sink(io.RawIOBase):
    """Buffers the bytes that `ZipFile` writes until `fetch`; not readable or seekable."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]
        self._waiting += data
        return len(data)

    def fetch(self) -> bytes:
        data = bytes(self._waiting)
        self._waiting.clear()
        return data


def zip_recordings(paths: Sequence[Path]) -> Iterator[bytes]:
    """Yield a zip file of recordings with their edits, block by block.

    Recordings are stored uncompressed, since their pictures are already compressed. A file that
    is being recorded is included up to its current end. Raises OSError if a recording cannot be
    read; the zip file is then truncated, which its receiver can detect.
    """
    sink = _Sink()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_STORED) as archive:
        for path in paths:
            for file in (path, notes_path(path)):
                if file is path or file.exists():
                    yield from _add(archive, sink, file)
    yield sink.fetch()


def _add(archive: zipfile.ZipFile, sink: _Sink, path: Path) -> Iterator[bytes]:
    entry = zipfile.ZipInfo.from_file(path, path.name, strict_timestamps=False)
    left = entry.file_size
    with path.open("rb") as source, archive.open(entry, "w", force_zip64=True) as target:
        while left > 0 and (block := source.read(min(left, _BLOCK_BYTES))):
            target.write(block)
            left -= len(block)
            yield sink.fetch()
