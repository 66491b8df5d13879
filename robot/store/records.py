"""Append-only files of records with checksums. Each record is written to two files, so that damage
to one file loses no record.

A record is a magic word, the length and the CRC-32 of the payload, and the payload. After damage a
reader searches for the next magic word. So a flipped byte destroys one record of one file, and a
truncation destroys the records after the cut.
"""

from __future__ import annotations

import contextlib
import os
import stat
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

MAGIC = b"\xd7DL1"
MAX_FILE_BYTES = 128 * 2**20
"""Maximum size of a file that is read, in bytes. This program writes no larger files."""
_HEAD = struct.Struct("<4sII")


def frame_record(payload: bytes) -> bytes:
    return _HEAD.pack(MAGIC, len(payload), zlib.crc32(payload)) + payload


def open_new(path: Path) -> BinaryIO:
    return path.open("xb")


class RecordWriter:
    """Writes the same records to several new files, as long as at least one can be written.

    Only one thread may use a writer, but another thread may call `sync`. Raises OSError if all
    files failed.
    """

    def __init__(
        self, paths: Sequence[Path], open_file: Callable[[Path], BinaryIO] = open_new
    ) -> None:
        self._files: list[BinaryIO] = []
        self.written_bytes = self._synced_bytes = 0
        last: OSError | None = None
        for path in paths:
            try:
                self._files.append(open_file(path))
            except OSError as error:
                last = error
        if not self._files:
            raise last or OSError("no file to write to")

    def write(self, payloads: Sequence[bytes]) -> None:
        """Append records, which then survive the end of the process, but not yet a power cut."""
        data = b"".join(map(frame_record, payloads))
        last = self._with_each(lambda file: (file.write(data), file.flush()))
        self.written_bytes += len(data)
        if not self._files:
            raise last or OSError("the files are closed")

    def sync(self) -> None:
        """Flush the files to the disk; a file that fails is no longer written."""
        if self._synced_bytes == self.written_bytes:
            return
        self._synced_bytes = self.written_bytes
        self._with_each(lambda file: os.fsync(file.fileno()))

    def _with_each(self, use: Callable[[BinaryIO], object]) -> Exception | None:
        """Use each file, and drop those that fail; return the last error."""
        last = None
        for file in list(self._files):
            try:
                use(file)
            except (OSError, ValueError) as error:  # another thread may have closed the file
                last = error
                self._leave_out(file)
        return last

    def _leave_out(self, file: BinaryIO) -> None:
        with contextlib.suppress(OSError, ValueError):
            self._files.remove(file)
            file.close()

    def close(self) -> None:
        """Close the open files without waiting for the disk; idempotent."""
        for file in list(self._files):
            self._leave_out(file)


def read_records(path: Path) -> Iterator[bytes]:
    """Yield all valid records of a file, in order. Raises OSError if it is not a regular file."""
    data = read_regular(path, MAX_FILE_BYTES)
    at = 0
    while (at := data.find(MAGIC, at)) >= 0:
        payload = _payload_at(data, at)
        if payload is not None:
            yield payload
        at += 1 if payload is None else _HEAD.size + len(payload)


def read_regular(path: Path | str, max_bytes: int) -> bytes:
    """Return the bytes of a regular file, without waiting for a pipe or following a link."""
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    handle = os.open(path, flags | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(f"{Path(path).name} is not a regular file")
        if status.st_size > max_bytes:
            raise OSError(f"{Path(path).name} has more than {max_bytes >> 20} MB")
        return file.read(status.st_size)  # to allocate `max_bytes` instead may take a second


def _payload_at(data: bytes, at: int) -> bytes | None:
    if at + _HEAD.size > len(data):
        return None
    _, length, checksum = _HEAD.unpack_from(data, at)
    start = at + _HEAD.size
    payload = data[start : start + length]
    return payload if len(payload) == length and zlib.crc32(payload) == checksum else None
