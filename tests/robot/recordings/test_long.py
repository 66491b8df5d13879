"""Long recordings: the memory per picture when they are opened."""

from __future__ import annotations

import gc
import struct
from pathlib import Path

import pytest

from robot.recordings.editing import moments, sample
from robot.recordings.edits import Notes
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.messages import Topic
from robot.types import DEFAULT_MOVES

from .long_recording import ENDS, begin, teach
from .test_cut import messages

pytest.importorskip("mcap.writer", reason="the extra 'episodes' is not installed")


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 6,000 pictures in some six chunks, with the last fifty lessons undone."""
    path = tmp_path_factory.mktemp("long") / "long.mcap"
    writer = begin(path.open("xb"))
    teach(writer, 6000)
    undone = {"event": "undone", "frames": list(range(5951, 6001))}
    writer.write_message(Topic.LESSON, 201.0, undone)
    writer.close(ENDS)
    return path


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
    assert most < 4000, "messages of two chunks at most"
    assert number == 6000


def test_a_few_pictures_are_found_without_the_others(long: Path) -> None:
    episode = open_episode(long)
    every = list(moments(episode, Notes()))
    assert sample(episode, Notes(), 7) == [every[round(i * 5999 / 6)] for i in range(7)]
    assert sample(episode, Notes(), 3, (1001, 2001)) == [every[i] for i in (1000, 1500, 2000)]
    assert sample(episode, Notes(), 3, (7000, 8000)) == []


@pytest.mark.parametrize("offset", [2**63 + 5, 3])
def test_a_false_index_is_not_used(long: Path, tmp_path: Path, offset: int) -> None:
    found, data, at = messages(long), bytearray(long.read_bytes()), 8
    while data[at] != 2:  # the footer
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == 7 and length > 6 + 32:  # a message index: its second offset
            struct.pack_into("<Q", data, at + 9 + 6 + 16 + 8, offset)
        at += 9 + length
    lying = tmp_path / "lying.mcap"
    lying.write_bytes(data)
    assert messages(lying) == found and len(found) == 6000 * 5 + 1
