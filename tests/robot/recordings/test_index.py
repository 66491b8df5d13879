"""A recording that is opened by its index equals one that is read chunk by chunk.

Opening needs little time and memory, however long the recording is."""

from __future__ import annotations

import gc
import random
import struct
import tracemalloc
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from robot.errors import RobotError
from robot.recordings import episode as reading
from robot.recordings import index, reader
from robot.recordings.editing import moments, sample
from robot.recordings.edits import Notes
from robot.recordings.ending import end_cut_recordings
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.index import INDEX
from robot.recordings.messages import Topic
from robot.recordings.reader import Attachment, Message, Metadata, read_ends, read_metadata, scan
from robot.recordings.summary import read_summary
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.testing import VirtualClock
from robot.types import DEFAULT_MOVES
from tests.kit.frames import jpeg_frame
from tests.kit.sizes import crossed, seeds

from .drives import content, record_drive
from .test_damaged import messages

HEAD = struct.Struct("<II")
ENDS = {"dropped_frames": "0", "lost_words": "0"}
VECTOR = {"dtype": "<f4", "shape": [2], "data": "AACAPwAAAEA="}


def begin(file: BinaryIO, model: bytes | None = None, **more: Any) -> EpisodeWriter:
    """Begin a robot's recording in a new file, with the bytes of its model if there are any; `more`
    are arguments of the writer."""
    run = describe_run(
        episode_id=Path(file.name).stem,
        run_id="long",
        origin_ns=1_700_000_000 * 10**9,
        started_at_s=1_700_000_000.0,
        robot="sim",
        learner="knn-3",
        moves=DEFAULT_MOVES,
    )
    return EpisodeWriter(file, run, model, **more)


def teach(writer: EpisodeWriter, first: int, count: int) -> None:
    """Write examples and edits of every kind, in small chunks."""
    for number in range(first, first + count):
        now_s, label = number / 30, DEFAULT_MOVES[number // 7 % 3]
        width, data = 160 if number % 50 else 80, b"\xff\xd8" + bytes(300)
        writer.write_frame(jpeg_frame(number, now_s, data, width))
        lesson: dict[str, Any] = {"event": "taught", "frame": number, "label": label}
        lesson |= {"intervention": number % 5 == 0, "at_s": now_s, "x": None}
        lesson |= {"steering": -0.5, "throttle": 0.25} if number % 11 == 0 else {}
        writer.write_message(Topic.LESSON, now_s, lesson)
        if number % 40 == 0:
            writer.write_message(Topic.LESSON, now_s, lesson | {"frame": 9999, "x": VECTOR})
            undone = {"event": "undone", "frames": [number - 1, number - 30]}
            writer.write_message(Topic.LESSON, now_s, undone)
            writer.write_message(Topic.RESULT, now_s, {"of": "challenge", "metres": number / 8})
        if number % 6 == 0:
            writer.flush()


def teach_long(writer: EpisodeWriter, count: int) -> None:
    """Write all that the recorder writes if every picture teaches the robot."""
    rng = np.random.default_rng(1)
    for number in range(1, count + 1):
        now_s, label = number / 30, DEFAULT_MOVES[number // 40 % 3]
        said = {"frame": number, "action": label, "confidence": 0.9}
        drove = {"action": label, "sent": label, "driven_by": "pilot", "asks_pilot": False}
        taught = {"event": "taught", "frame": number, "label": label, "intervention": False}
        writer.write_frame(jpeg_frame(number, now_s, rng.bytes(1900)))
        writer.write_message(Topic.SENSORS, now_s, {"distance_m": number / 1000, "pose": None})
        writer.write_message(Topic.PREDICTION, now_s, said)
        writer.write_message(Topic.DECISION, now_s, drove)
        writer.write_message(Topic.LESSON, now_s, taught | {"at_s": now_s, "x": None})


@pytest.fixture(scope="module")
def varied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("varied") / "varied.mcap"
    writer = begin(path.open("xb"), b"before", section_frames=100)
    teach(writer, 1, 340)
    writer.write_frame(jpeg_frame(20, 12.0, b"\xff\xd8again"))
    writer.write_message(Topic.LESSON, 12.0, {"event": "undone", "frames": [340, 2]})
    writer.close(ENDS, b"after")
    return path


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 6,000 pictures in about six chunks, whose last fifty examples were undone."""
    path = tmp_path_factory.mktemp("long") / "long.mcap"
    writer = begin(path.open("xb"))
    teach_long(writer, 6000)
    undone = {"event": "undone", "frames": list(range(5951, 6001))}
    writer.write_message(Topic.LESSON, 201.0, undone)
    writer.close(ENDS)
    return path


def everything(episode: Episode) -> dict[str, Any]:
    found = content(episode)  # this reads the whole file, because the order is unknown before
    about = episode.run, episode.attachments, episode.moves, episode.frames.is_ordered
    return found | {"about": about}


def walked(path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    with monkeypatch.context() as patch:
        patch.setattr(reading, "read_columns", lambda _: None)
        return everything(open_episode(path))


def test_opening_by_the_index_equals_reading_all_chunks(
    varied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = walked(varied, monkeypatch)
    assert len(wanted["frames"]) == 340 and len(wanted["results"]) == 8
    assert not wanted["about"][-1] and 9999 in wanted["taught"]
    monkeypatch.setattr(reading, "walk_part", None)
    assert everything(open_episode(varied)) == wanted
    assert sum(isinstance(one, Attachment) and one.name == INDEX for one in scan(varied)) == 4


def test_a_recording_rewritten_by_another_program_is_read_by_its_chunks(
    varied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted, path = walked(varied, monkeypatch), tmp_path / "varied.mcap"
    with path.open("xb") as file:
        writer = Writer(file, chunk_size=3000)
        writer.start(profile="", library="another")
        numbers: dict[Any, int] = {}
        for one in scan(varied):
            if isinstance(one, Metadata):
                writer.add_metadata(one.name, one.values)
            elif isinstance(one, Attachment):
                writer.add_attachment(0, 0, one.name, "application/zip", one.data)
            elif isinstance(one, Message):
                channel = one.channel
                if channel not in numbers:
                    schema = writer.register_schema(*channel.schema)
                    about = channel.topic, channel.encoding, schema, dict(channel.metadata)
                    numbers[channel] = writer.register_channel(*about)
                stamp = one.log_ns
                writer.add_message(numbers[channel], stamp, one.data, stamp, one.sequence)
        writer.finish()
    assert everything(open_episode(path)) == wanted


def test_a_damaged_index_only_costs_time(
    varied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted, data = walked(varied, monkeypatch), varied.read_bytes()
    rng, path = np.random.default_rng(1), tmp_path / "varied.mcap"
    places = [at for at in range(len(data)) if data.startswith(INDEX.encode(), at)]
    for place in places[:4]:
        damaged = bytearray(data)
        damaged[place + int(rng.integers(40, 400))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        found = everything(open_episode(path))
        assert found["frames"] == wanted["frames"] and found["events"] == wanted["events"]


def test_a_false_index_raises_only_our_own_errors(
    varied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, ends = random.Random(4), read_ends(varied, INDEX, ())
    for _ in seeds(40, 400):
        number = rng.randrange(len(ends.sections))
        section = ends.sections[number]
        _, length = HEAD.unpack_from(section.data)
        plain = bytearray(zlib.decompress(section.data[HEAD.size :]))
        for _ in range(rng.randrange(1, 4)):
            plain[rng.randrange(len(plain))] = rng.choice((0, 48, 255, rng.randrange(256)))
        packed = zlib.compress(plain)
        lying = section._replace(data=HEAD.pack(zlib.crc32(packed), length) + packed)
        sections = [*ends.sections[:number], lying, *ends.sections[number + 1 :]]
        told = ends._replace(sections=sections)
        monkeypatch.setattr(index, "read_ends", lambda *_, told=told: told)
        with suppress(RobotError):
            episode = open_episode(varied)
            list(episode.events)
            taught_frames(episode)
            list(moments(episode, Notes()))
            episode.frame(int(episode.frames.ids[5]))


@pytest.mark.parametrize("offset", [2**63 + 5, 3])
def test_a_false_index_of_messages_is_not_used(long: Path, tmp_path: Path, offset: int) -> None:
    found, data, at = messages(long), bytearray(long.read_bytes()), 8
    while data[at] != 2:  # the footer
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == 7 and length > 6 + 32:  # a message index: its second offset
            struct.pack_into("<Q", data, at + 9 + 6 + 16 + 8, offset)
        at += 9 + length
    lying = tmp_path / "lying.mcap"
    lying.write_bytes(data)
    assert messages(lying) == found and len(found) == 6000 * 5 + 1


@crossed(frames=[1, 12, 400], read_bytes=[64, 8192])
def test_the_list_reads_only_the_ends_of_a_file_and_finds_what_the_library_finds(
    tmp_path: Path, frames: int, read_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "_BUFFER_BYTES", read_bytes)
    path = record_drive(tmp_path, frames=frames).path
    with path.open("rb") as file:
        found = {record.name: dict(record.metadata) for record in make_reader(file).iter_metadata()}
    if frames == 400:  # damage the middle, which must not be read
        data = path.read_bytes()
        path.write_bytes(data[:10_000] + bytes(len(data) - 50_000) + data[-40_000:])
    assert read_metadata(path) == found and len(found) == 2


# Memory ------------------------------------------------------------------------------------------


def test_an_open_recording_has_no_object_for_each_picture(long: Path) -> None:
    open_episode(long)
    gc.collect()
    before = len(gc.get_objects())
    episode = open_episode(long)
    labels = taught_frames(episode)
    gc.collect()
    assert len(gc.get_objects()) - before < 500
    assert len(episode.frames) == 6000 and len(labels) == 5950


def test_the_data_of_pictures_are_read_chunk_by_chunk(long: Path) -> None:
    episode, most = open_episode(long), 0
    gc.collect()
    before = len(gc.get_objects())
    for number, moment in enumerate(moments(episode, Notes()), 1):
        assert moment.frame_id == number
        assert moment.label == (DEFAULT_MOVES[number // 40 % 3] if number <= 5950 else None)
        assert moment.predicted == moment.sent == DEFAULT_MOVES[number // 40 % 3]
        assert moment.driven_by == "pilot" and moment.distance_m == number / 1000
        if number % 500 == 0:
            most = max(most, len(gc.get_objects()) - before)
    assert most < 4000, "the reader holds the messages of two chunks at most"
    assert number == 6000


def test_a_few_pictures_are_found_without_the_others(long: Path) -> None:
    episode = open_episode(long)
    every = list(moments(episode, Notes()))
    assert sample(episode, Notes(), 7) == [every[round(i * 5999 / 6)] for i in range(7)]
    assert sample(episode, Notes(), 3, (1001, 2001)) == [every[i] for i in (1000, 1500, 2000)]
    assert sample(episode, Notes(), 3, (7000, 8000)) == []


def test_counting_and_completing_leave_memory_and_processor_to_the_robot(
    long: Path, tmp_path: Path
) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(long.read_bytes()[:3_000_000])
    tracemalloc.start()
    summary = read_summary(path)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert summary.frames > 1000 and summary.damage
    assert peak_bytes < path.stat().st_size + 2 * 2**20
    clock, held = VirtualClock(0.0), len(messages(path))
    end_cut_recordings([path], clock)
    assert len(messages(path)) == held > 5000
    assert clock.now_s() == pytest.approx(0.003 * held / 32, rel=0.1), "3 ms after 32 records"
