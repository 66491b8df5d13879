"""A recording opened by its index equals the same recording read chunk by chunk."""

from __future__ import annotations

import gc
import random
import struct
import tracemalloc
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot.errors import RobotError
from robot.recordings import episode as reading
from robot.recordings import index
from robot.recordings.editing import moments
from robot.recordings.edits import Notes
from robot.recordings.episode import Episode, open_episode, taught_frames
from robot.recordings.index import INDEX
from robot.recordings.messages import Topic
from robot.recordings.reader import Attachment, Message, Metadata, read_ends, scan
from robot.recordings.writer import EpisodeWriter
from robot.types import DEFAULT_MOVES
from tests.kit.frames import jpeg_frame
from tests.kit.sizes import seeds

from .drives import content
from .long_recording import ENDS, begin

mcap = pytest.importorskip("mcap.writer", reason="the extra 'episodes' is not installed")
HEAD = struct.Struct("<II")
VECTOR = {"dtype": "<f4", "shape": [2], "data": "AACAPwAAAEA="}


def teach(writer: EpisodeWriter, first: int, count: int) -> None:
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


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("long") / "long.mcap"
    writer = begin(path.open("xb"), b"before", section_frames=100)
    teach(writer, 1, 340)
    writer.write_frame(jpeg_frame(20, 12.0, b"\xff\xd8again"))
    writer.write_message(Topic.LESSON, 12.0, {"event": "undone", "frames": [340, 2]})
    writer.close(ENDS, b"after")
    return path


def everything(episode: Episode) -> dict[str, Any]:
    found = content(episode)  # reads all; only then the order is known
    about = episode.run, episode.attachments, episode.moves, episode.frames.is_ordered
    return found | {"about": about}


def walked(path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    with monkeypatch.context() as patch:
        patch.setattr(reading, "read_columns", lambda _: None)
        return everything(open_episode(path))


def test_opening_by_the_index_equals_reading_all_chunks(
    long: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = walked(long, monkeypatch)
    assert len(wanted["frames"]) == 340 and len(wanted["results"]) == 8
    assert not wanted["about"][-1] and 9999 in wanted["taught"]
    monkeypatch.setattr(reading, "walk_part", None)
    assert everything(open_episode(long)) == wanted
    assert sum(isinstance(one, Attachment) and one.name == INDEX for one in scan(long)) == 4


def test_a_recording_rewritten_by_another_program_is_read_by_its_chunks(
    long: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted, path = walked(long, monkeypatch), tmp_path / "long.mcap"
    with path.open("xb") as file:
        writer = mcap.Writer(file, chunk_size=3000)
        writer.start(profile="", library="another")
        numbers: dict[Any, int] = {}
        for one in scan(long):
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
    long: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted, data = walked(long, monkeypatch), long.read_bytes()
    rng, path = np.random.default_rng(1), tmp_path / "long.mcap"
    places = [at for at in range(len(data)) if data.startswith(INDEX.encode(), at)]
    for place in places[:4]:
        damaged = bytearray(data)
        damaged[place + int(rng.integers(40, 400))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        found = everything(open_episode(path))
        assert found["frames"] == wanted["frames"] and found["events"] == wanted["events"]


def test_a_false_index_raises_only_our_own_errors(
    long: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng, ends = random.Random(4), read_ends(long, INDEX, ())
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
            episode = open_episode(long)
            list(episode.events)
            taught_frames(episode)
            list(moments(episode, Notes()))
            episode.frame(int(episode.frames.ids[5]))


def test_the_recorder_keeps_the_columns_of_a_section(tmp_path: Path) -> None:
    """Before, the recorder kept 490 bytes for each picture, in sets and a table of examples."""
    writer = begin((tmp_path / "one.mcap").open("xb"), section_frames=150)
    teach(writer, 1, 300)
    gc.collect()
    tracemalloc.start()
    teach(writer, 301, 600)
    gc.collect()
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    writer.close(ENDS)
    assert grown / 600 < 250
