"""The data read from the two ends of a recording equals what the library finds in it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from robot.recordings import reader
from robot.recordings.reader import read_metadata
from tests.kit.sizes import crossed

from .drives import record_drive


@crossed(frames=[1, 12, 400], read_bytes=[64, 8192])
def test_reading_the_ends_finds_what_the_library_finds(
    tmp_path: Path, frames: int, read_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "_BUFFER_BYTES", read_bytes)
    path = record_drive(tmp_path, frames=frames).path
    with path.open("rb") as file:
        found = {record.name: dict(record.metadata) for record in make_reader(file).iter_metadata()}
    assert read_metadata(path) == found and len(found) == 2


def test_little_is_read_of_a_large_file(tmp_path: Path) -> None:
    path = record_drive(tmp_path, frames=400).path
    assert path.stat().st_size > 200_000

    class Counting(io.FileIO):
        total = 0

        def readinto(self, buffer: Any) -> int | None:
            size = super().readinto(buffer)
            self.total += size or 0
            return size

    raw = Counting(path)
    with io.BufferedReader(raw, reader._BUFFER_BYTES) as file:
        assert len(reader.metadata_of(file)) == 2
        assert 0 < raw.total <= 4096 + 32768
