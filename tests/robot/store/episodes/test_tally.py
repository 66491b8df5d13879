"""A recording that was cut short is counted as it would be opened, and without keeping it."""

from __future__ import annotations

import random
import tracemalloc
from pathlib import Path

import pytest

from robot.store.episodes import summary
from robot.store.episodes.summary import read_summary
from robot.store.episodes.tally import count_cut_recording

from .drives import RecordedBench, record_drive
from .long_recording import write_cut_recording


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A drive of several flushes, with an undo in it."""
    robot = RecordedBench(tmp_path_factory.mktemp("drive"))
    robot.drive(range(60))
    robot.loop.submit(lambda: robot.loop.history.undo(0.7))
    robot.tick()
    robot.drive(range(60, 130))
    [path] = robot.finish()
    return path.read_bytes()


@pytest.mark.parametrize("seed", range(60))
def test_a_cut_recording_is_counted_as_it_is_opened(
    tmp_path: Path, whole: bytes, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(seed)
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: rng.randrange(1, len(whole))])
    tally = count_cut_recording(path)
    counted = read_summary(path)
    monkeypatch.setattr(summary, "_count_cut", lambda path: None)
    opened = read_summary(path)
    assert (counted.frames, counted.taught, counted.damage) == (
        opened.frames,
        opened.taught,
        opened.damage,
    )
    assert counted.duration_s == pytest.approx(opened.duration_s, abs=1e-6)
    assert (counted.started_at_s, counted.is_readable) == (opened.started_at_s, opened.is_readable)
    assert tally is not None or not opened.is_readable or opened.damage != "the file was cut short"


@pytest.mark.parametrize("seed", range(60))
def test_whatever_else_is_wrong_is_left_to_whoever_opens_it(
    tmp_path: Path, whole: bytes, seed: int
) -> None:
    rng = random.Random(seed)
    data = bytearray(whole[: rng.choice([len(whole), len(whole) - 2000])])
    for _ in range(rng.randrange(1, 8)):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    tally = count_cut_recording(path)
    assert tally is None or len(tally.frames) <= 132
    assert read_summary(path).bytes == len(data)


def test_a_whole_recording_is_none_that_was_cut(tmp_path: Path) -> None:
    assert count_cut_recording(record_drive(tmp_path).path) is None


def test_counting_keeps_nothing_of_the_pictures(tmp_path: Path) -> None:
    path = write_cut_recording(tmp_path / "long.mcap", minutes=1.0)
    tracemalloc.start()
    tally = count_cut_recording(path)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert tally is not None and len(tally.frames) > 1500
    assert peak_bytes < path.stat().st_size + 2**20 and peak_bytes < 8 * 2**20
