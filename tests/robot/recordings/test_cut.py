"""A truncated recording is counted like an opened one, without holding it in memory."""

from __future__ import annotations

import random
import tracemalloc
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader

from robot.errors import RecordingError, RobotError
from robot.policy.registry import make_policy
from robot.recordings.edits import Notes
from robot.recordings.ending import end_cut_recordings, end_recording
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.messages import RUN, SUMMARY
from robot.recordings.reader import Message, read_metadata, scan
from robot.recordings.summary import read_summary
from robot.recordings.teaching import learn_again
from robot.testing import VirtualClock
from tests.kit.sizes import seeds

from .drives import RecordedBench
from .long_recording import write_cut_recording


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A drive of several flushes, with an undo."""
    robot = RecordedBench(tmp_path_factory.mktemp("drive"))
    robot.drive(range(60))
    robot.loop.submit(lambda: robot.loop.history.undo(0.7))
    robot.tick()
    robot.drive(range(60, 130))
    [path] = robot.finish()
    return path.read_bytes()


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory, whole: bytes) -> list[tuple[int, bytes]]:
    """The ids and bytes of the drive's pictures."""
    path = tmp_path_factory.mktemp("whole") / "whole.mcap"
    path.write_bytes(whole)
    episode = open_episode(path)
    return [(i, episode.frame(i).data) for i in episode.frames]


def opened_as(path: Path) -> tuple[int, dict[str, int], str | None]:
    """Return the number of pictures, the examples and the fault, from the whole file."""
    episode = open_episode(path)
    taught = Counter(str(example.label) for example in taught_frames(episode).values())
    return len(episode.frames), dict(taught), episode.damage


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_a_cut_recording_is_counted_opened_and_learned_up_to_the_cut(
    tmp_path: Path, whole: bytes, pictures: list[tuple[int, bytes]], seed: int
) -> None:
    rng = random.Random(seed)
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: rng.randrange(1, len(whole))])
    counted = read_summary(path)
    if not counted.is_readable:
        assert path.stat().st_size < 400
        with pytest.raises(RecordingError):
            open_episode(path)
        return
    assert (counted.frames, counted.taught, counted.damage) == opened_as(path)
    episode = open_episode(path)
    assert counted.duration_s == pytest.approx(episode.duration_s, abs=1e-6)
    assert counted.started_at_s == pytest.approx(episode.started_at_s, abs=1e-3)
    assert counted.damage
    assert [(i, episode.frame(i).data) for i in episode.frames] == pictures[: counted.frames]
    learn_again(make_policy("published-8"), [(episode, Notes())])


def by_library(path: Path) -> list[tuple[str, int, bytes]]:
    """Read all messages by the library itself, which uses the index."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


def messages(path: Path) -> list[tuple[str, int, bytes]]:
    return [(m.topic, m.log_ns, m.data) for m in scan(path) if isinstance(m, Message)]


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_a_cut_recording_gets_its_end_and_keeps_all_that_it_has(
    tmp_path: Path, whole: bytes, seed: int
) -> None:
    path = tmp_path / "cut.mcap"
    cut = random.Random(seed).randrange(1, len(whole) if seed % 3 else 2500)
    path.write_bytes(whole[: -cut if seed % 3 == 0 else cut])
    before, held = read_summary(path), messages(path) if cut > 8 else []
    if seed % 5 == 0:
        path.write_bytes(path.read_bytes() + bytes(3000))  # as a power cut may leave it
    ended = end_recording(path)
    assert ended or not before.is_readable or seed % 5 == 0  # zeros may end a chunk wrongly
    if ended:
        opened = open_episode(path)
        assert messages(path) == held
        assert sorted(by_library(path), key=repr) == sorted(held, key=repr)
        assert read_metadata(path).keys() == {RUN, SUMMARY}
        assert read_summary(path) == replace(
            before, bytes=path.stat().st_size, damage=opened.damage
        )
        assert opened.damage in ("the file was cut short", None)
        assert opened.damage or opened.model_after() is not None
        assert all(opened.frame(frame_id).data for frame_id in list(opened.frames)[::20])
        assert not end_recording(path)


@pytest.mark.parametrize("seed", seeds(4, 30))
def test_a_file_that_is_damaged_in_another_way_is_left_as_it_is(
    tmp_path: Path, whole: bytes, seed: int
) -> None:
    """Every readable message stays; before, nothing behind a wrong length was readable."""
    rng = random.Random(seed)
    data = bytearray(whole[: len(whole) - rng.choice([0, 2000])])
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    held = messages(path)
    if not end_recording(path):
        assert path.read_bytes() == data
    assert messages(path) == held


def test_the_next_start_ends_it(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole[: len(whole) // 2])
    (tmp_path / "other.mcap").write_bytes(b"no recording")
    robot = RecordedBench(tmp_path)
    robot.stand(2)
    robot.finish()
    assert read_metadata(path).keys() == {RUN, SUMMARY}
    assert read_summary(path).damage == "the file was cut short"
    assert (tmp_path / "other.mcap").read_bytes() == b"no recording"


def test_while_it_is_ended_the_robot_has_the_processor(tmp_path: Path) -> None:
    clock, path = VirtualClock(0.0), write_cut_recording(tmp_path / "cut.mcap", minutes=0.2)
    held = len(messages(path))
    end_cut_recordings([path], clock)
    assert len(messages(path)) == held > 900
    assert clock.now_s() == pytest.approx(0.003 * held / 32, rel=0.1), "a rest after 32 records"


@pytest.mark.parametrize("seed", seeds(12, 150))
def test_whatever_else_is_wrong_it_is_described_and_no_foreign_error_is_raised(
    tmp_path: Path, whole: bytes, seed: int
) -> None:
    rng = random.Random(seed)
    data = bytearray(whole[: rng.choice([len(whole), len(whole) - 2000])])
    for _ in range(rng.randrange(1, 8)):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    summary = read_summary(path)
    assert summary.bytes == len(data) and summary.frames <= 132
    with suppress(RobotError):
        episode = open_episode(path)
        for frame_id in list(episode.frames)[::20]:
            episode.frame(frame_id)


def test_counting_keeps_nothing_of_the_pictures(tmp_path: Path) -> None:
    path = write_cut_recording(tmp_path / "long.mcap", minutes=1.0)
    tracemalloc.start()
    summary = read_summary(path)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert summary.frames > 1500 and summary.damage
    assert peak_bytes < path.stat().st_size + 2 * 2**20 and peak_bytes < 7 * 2**20
