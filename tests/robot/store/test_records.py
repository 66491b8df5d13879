"""Reading files of records; models/test_journal.py tests the journal's content."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from robot.store.records import read_regular


def test_a_small_file_takes_no_buffer_for_a_large_one(tmp_path: Path) -> None:
    """Before, such a buffer took a second on Windows for each model in a list."""
    path = tmp_path / "model"
    path.write_bytes(bytes(range(256)))
    tracemalloc.start()
    try:
        assert read_regular(path, 1 << 28) == bytes(range(256))
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_files_that_are_too_large_or_not_regular_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "model"
    path.write_bytes(bytes(256))
    assert len(read_regular(path, 256)) == 256
    with pytest.raises(OSError, match="more than"):
        read_regular(path, 255)
    with pytest.raises(OSError):
        read_regular(tmp_path, 1 << 20)
