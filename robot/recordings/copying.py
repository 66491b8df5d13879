"""Copies all files of a recording into one file, message by message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import BinaryIO

from robot.recordings.episode import Episode
from robot.recordings.messages import MODEL_AFTER, MODEL_BEFORE, RUN, SUMMARY
from robot.recordings.parts import scan_parts
from robot.recordings.reader import Cut, Metadata
from robot.recordings.writer import EpisodeWriter


def copy_recording(episode: Episode, file: BinaryIO, run: Mapping[str, str]) -> Iterator[None]:
    """Write a copy that begins with the metadata `run`; yield after each record.

    A truncated file of the recording is copied as far as it is readable.
    """
    attached = episode.attachments
    writer = EpisodeWriter(file, run, attached.get(MODEL_BEFORE))
    for record in scan_parts(episode.path):
        is_ours = isinstance(record, Metadata) and record.name in (RUN, SUMMARY)
        is_model = getattr(record, "name", "") in (MODEL_BEFORE, MODEL_AFTER)
        if not isinstance(record, Cut) and not is_ours and not is_model:
            writer.write_copy(record)
            yield
    damage = {} if episode.damage is None else {"damage": episode.damage}
    ends = {"dropped_frames": "0", "lost_words": "0", **damage}
    writer.close(ends, attached.get(MODEL_AFTER))
