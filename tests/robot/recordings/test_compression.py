"""Chunks of a recording are compressed quickly for JPEG pictures, and well for raw pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader

from robot.recordings.episode import open_episode
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.types import Encoding
from tests.kit.frames import make_frame

from .drives import RecordedBench


@pytest.mark.parametrize(("encoding", "compression"), [("jpeg", "lz4"), ("rgb", "zstd")])
def test_chunks_are_compressed_to_suit_the_pictures(
    tmp_path: Path, encoding: str, compression: str
) -> None:
    path, frame = tmp_path / "drive.mcap", make_frame(b"\xff\xd8" * 50, Encoding(encoding))
    run = describe_run(episode_id="drive", run_id="r", origin_ns=0, pictures=frame.encoding)
    writer = EpisodeWriter(path.open("xb"), run)
    writer.write_frame(frame)
    writer.close({"dropped_frames": "0", "lost_words": "0"})
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert {chunk.compression for chunk in summary.chunk_indexes} == {compression}
    episode = open_episode(path)
    assert episode.frame(frame.frame_id).data == frame.data


def test_a_recording_says_how_its_pictures_are_encoded(tmp_path: Path) -> None:
    robot = RecordedBench(tmp_path)
    robot.drive(range(8))
    assert robot.loop.learning.frame is not None
    assert robot.episode().run["pictures"] == robot.loop.learning.frame.encoding
