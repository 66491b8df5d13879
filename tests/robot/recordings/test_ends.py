"""The data read from the two ends of a recording equals what the library finds in it."""

from __future__ import annotations

import io
import os
import random
from pathlib import Path
from typing import Any

import pytest

from robot.errors import RecordingError
from robot.recordings import reader
from robot.recordings.reader import read_metadata
from robot.recordings.summary import read_summary
from tests.kit.sizes import crossed, seeds

from .drives import record_drive


def by_library(path: Path) -> dict[str, dict[str, str]]:
    from mcap.reader import SeekingReader

    with path.open("rb") as file:
        records = SeekingReader(file).iter_metadata()
        return {record.name: dict(record.metadata) for record in records}


@crossed(frames=[1, 12, 400], read_bytes=[64, 8192])
def test_it_finds_what_the_library_finds(
    tmp_path: Path, frames: int, read_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "_BUFFER_BYTES", read_bytes)
    path = record_drive(tmp_path, frames=frames).path
    assert read_metadata(path) == by_library(path)
    assert len(read_metadata(path)) == 2


def test_little_is_read_of_a_large_file(tmp_path: Path) -> None:
    path = record_drive(tmp_path, frames=400).path
    assert path.stat().st_size > 200_000

    class Counting(io.FileIO):
        total = 0

        def readinto(self, buffer: Any) -> int | None:
            size = super().readinto(buffer)
            self.total += size or 0
            return size

        def read(self, size: int = -1) -> bytes:
            data = super().read(size)
            self.total += len(data)
            return data

    raw = Counting(path)
    with io.BufferedReader(raw, reader._BUFFER_BYTES) as file:
        assert len(reader.metadata_of(file)) == 2
        assert 0 < raw.total <= 4096 + 32768


@pytest.mark.parametrize("seed", seeds(10, 150))
def test_whatever_was_damaged_it_is_described_or_refused(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    path = record_drive(tmp_path, frames=4).path
    data = bytearray(path.read_bytes())
    how = seed % 5
    if how == 0:
        del data[rng.randrange(len(data)) :]
    elif how == 1:  # the footer, and the records before it
        data[-rng.randrange(1, 60)] ^= 1 << rng.randrange(8)
    elif how == 2:
        for _ in range(rng.randrange(1, 20)):
            data[-rng.randrange(1, min(len(data), 1200))] = rng.randrange(256)
    elif how == 3:
        data[-28 : -28 + 8] = rng.choice([0, 1, len(data), 2**63, 2**64 - 1]).to_bytes(8, "little")
    else:
        data = bytearray(os.urandom(rng.randrange(0, 200)))
    path.write_bytes(data)
    try:
        read_metadata(path)
    except RecordingError as error:
        assert str(error)
    summary = read_summary(path)
    assert summary.id == path.stem and summary.bytes == len(data)
