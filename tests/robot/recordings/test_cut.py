"""Cut and damaged recordings: counted like an opened one, ended, and never trusted."""

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

Messages = list[tuple[str, int, bytes]]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A drive of several flushes, with an undo."""
    robot = RecordedBench(tmp_path_factory.mktemp("drive"))
    robot.drive(range(60))
    robot.undo(0.7)
    robot.drive(range(60, 130))
    return robot.finish()[0].read_bytes()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "cut.mcap"


def messages(path: Path) -> Messages:
    return [(m.topic, m.log_ns, m.data) for m in scan(path) if isinstance(m, Message)]


def by_library(path: Path) -> Messages:
    """Read all messages by the library itself, which uses the index."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_a_cut_recording_is_counted_opened_and_learned_up_to_the_cut(
    path: Path, whole: bytes, seed: int
) -> None:
    path.write_bytes(whole)
    episode = open_episode(path)
    pictures = [(i, episode.frame(i).data) for i in episode.frames]
    path.write_bytes(whole[: random.Random(seed).randrange(1, len(whole))])
    counted = read_summary(path)
    if not counted.is_readable:
        assert path.stat().st_size < 400
        with pytest.raises(RecordingError):
            open_episode(path)
        return
    episode = open_episode(path)
    taught = Counter(str(example.label) for example in taught_frames(episode).values())
    assert counted.damage and counted.damage == episode.damage
    assert (counted.frames, counted.taught) == (len(episode.frames), dict(taught))
    assert counted.duration_s == pytest.approx(episode.duration_s, abs=1e-6)
    assert counted.started_at_s == pytest.approx(episode.started_at_s, abs=1e-3)
    assert [(i, episode.frame(i).data) for i in episode.frames] == pictures[: counted.frames]
    learn_again(make_policy("published-8"), [(episode, Notes())])


@pytest.mark.parametrize("seed", seeds(6, 60))
def test_a_cut_recording_gets_its_end_and_keeps_all_that_it_has(
    path: Path, whole: bytes, seed: int
) -> None:
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
        kept = replace(before, bytes=path.stat().st_size, damage=opened.damage)
        assert read_summary(path) == kept
        assert opened.damage in ("the file was cut short", None)
        assert opened.damage or opened.model_after() is not None
        assert all(opened.frame(frame_id).data for frame_id in list(opened.frames)[::20])
        assert not end_recording(path)


@pytest.mark.parametrize("seed", seeds(4, 30))
def test_a_file_that_is_damaged_in_another_way_is_left_as_it_is(
    path: Path, whole: bytes, seed: int
) -> None:
    """Every readable message stays; before, nothing behind a wrong length was readable."""
    rng = random.Random(seed)
    data = bytearray(whole[: len(whole) - rng.choice([0, 2000])])
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    held = messages(path)
    if not end_recording(path):
        assert path.read_bytes() == data
    assert messages(path) == held


@pytest.mark.parametrize("seed", seeds(20, 300))
def test_any_damage_is_described_and_raises_only_our_errors(
    path: Path, whole: bytes, seed: int
) -> None:
    rng, data = random.Random(seed), bytearray(whole)
    if seed % 2:
        del data[len(data) - 2000 :]
    if seed % 5 == 1:  # at the end: the footer, and the records before it
        for _ in range(rng.randrange(1, 20)):
            data[-rng.randrange(1, 1200)] = rng.randrange(256)
    elif seed % 5 == 2:
        data[-28 : -28 + 8] = rng.choice([0, 1, len(data), 2**63, 2**64 - 1]).to_bytes(8, "little")
    elif seed % 5 == 3:
        data = bytearray(rng.randbytes(rng.randrange(0, 200)))
    else:  # anywhere
        for _ in range(rng.randrange(1, 8)):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    summary = read_summary(path)
    assert summary.id == path.stem and summary.bytes == len(data) and summary.frames <= 132
    with suppress(RobotError):
        read_metadata(path)
    with suppress(RobotError):
        episode = open_episode(path)
        for frame_id in list(episode.frames)[::20]:
            episode.frame(frame_id)


def test_the_next_start_completes_a_cut_recording(path: Path, whole: bytes) -> None:
    path.write_bytes(whole[: len(whole) // 2])
    path.with_name("other.mcap").write_bytes(b"no recording")
    robot = RecordedBench(path.parent)
    robot.stand(2)
    robot.finish()
    assert read_metadata(path).keys() == {RUN, SUMMARY}
    assert read_summary(path).damage == "the file was cut short"
    assert path.with_name("other.mcap").read_bytes() == b"no recording"


def test_completing_a_cut_recording_leaves_the_processor_to_the_robot(path: Path) -> None:
    clock = VirtualClock(0.0)
    held = len(messages(write_cut_recording(path, minutes=0.2)))
    end_cut_recordings([path], clock)
    assert len(messages(path)) == held > 900
    assert clock.now_s() == pytest.approx(0.003 * held / 32, rel=0.1), "a rest after 32 records"


def test_counting_keeps_nothing_of_the_pictures(path: Path) -> None:
    write_cut_recording(path, minutes=1.0)
    tracemalloc.start()
    summary = read_summary(path)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert summary.frames > 1500 and summary.damage
    assert peak_bytes < path.stat().st_size + 2 * 2**20 and peak_bytes < 7 * 2**20
