"""Writes one recording: an MCAP file that is readable up to its last flush."""

from __future__ import annotations

import contextlib
import io
import json
import os
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, BinaryIO

from robot.errors import UNREADABLE
from robot.moves import Move
from robot.policy.events import HistoryEvent, describe_event, read_event, to_json
from robot.recordings.images import camera_channel, encode_image
from robot.recordings.index import INDEX, SECTION_FRAMES, Columns, encode
from robot.recordings.marks import Tally
from robot.recordings.messages import (
    MODEL_AFTER,
    MODEL_BEFORE,
    PART,
    RUN,
    SUMMARY,
    Fields,
    Topic,
    json_channel,
)
from robot.recordings.moves import to_text
from robot.recordings.poses import encode_pose, pose_channel
from robot.recordings.reader import (
    Attachment,
    Message,
    MessageChannel,
    Metadata,
    WrittenFile,
    require_mcap,
)
from robot.types import Action, Encoding, Frame

FORMAT = 1
_CHUNK_BYTES = 1 << 20


def describe_run(
    *,
    episode_id: str,
    run_id: str,
    origin_ns: int,
    started_at_s: float = 0.0,
    robot: str = "",
    learner: str = "",
    moves: Sequence[str] = (),
    declared_moves: Sequence[Move] = (),
    options: Mapping[str, Any] | None = None,
    source: str = "drive",
    pictures: Encoding | None = None,
) -> dict[str, str]:
    """Return the metadata at the beginning of a recording.

    `started_at_s` is the wall-clock time in seconds since 1970. `origin_ns` is the zero of the
    run's clock, in nanoseconds since 1970. All recordings of one run of the program have the same
    `run_id`; frame ids are unique within a run. `pictures` is the encoding of the first picture.
    """
    return {
        "format": str(FORMAT),
        "episode": episode_id,
        "run": run_id,
        "origin_ns": str(origin_ns),
        "started_at_s": f"{started_at_s:.3f}",
        "robot": robot,
        "learner": learner,
        "moves": ",".join(moves),
        "declared_moves": to_text(declared_moves),
        "options": json.dumps(dict(options or {}), default=str),
        "source": source,
        "pictures": pictures or "",
        "timed": "1",  # means that each example contains the time at which it was taught
    }


def describe_part(run: Mapping[str, str], number: int, before: Tally) -> dict[str, str]:
    """Return the metadata at the beginning of a recording's next file; `before` is the tally of all
    files before it."""
    return {**run, PART: json.dumps({"number": number, **before.counts})}


def describe_content(frames: int, taught: Mapping[Action, int], lasted_s: float) -> dict[str, str]:
    """Return the metadata at the end of a recording; `taught` counts the examples that were not
    undone."""
    return {
        "frames": str(frames),
        "taught": json.dumps({label: count for label, count in taught.items() if count}),
        "duration_s": f"{max(lasted_s, 0.0):.6f}",
    }


class EpisodeWriter:
    """Writes one MCAP file. For one thread only; raises OSError if the disk fails."""

    def __init__(
        self,
        file: BinaryIO,
        run: Mapping[str, str],
        model_before: bytes | None = None,
        section_frames: int = SECTION_FRAMES,
        tally: Tally | None = None,
    ) -> None:
        self._file = file
        self._origin_ns = int(run["origin_ns"])
        self._began_ns = round(float(run.get("started_at_s", "0")) * 1e9)
        require_mcap()
        from mcap.writer import CompressionType, Writer

        self._written = _Written(file)
        self._writer = Writer(
            self._written,
            chunk_size=_CHUNK_BYTES,
            # LZ4 takes a fifth of zstd's time, but makes raw pictures a fifth larger
            compression=CompressionType["LZ4" if run.get("pictures") == Encoding.JPEG else "ZSTD"],
        )
        self._schema = cache(lambda schema: self._writer.register_schema(*schema))
        self._channel = cache(self._register)
        self.tally = tally or Tally()
        self._section_frames = section_frames
        self._follower = WrittenFile()
        self._columns: Columns | None = Columns(self._origin_ns)
        self._section_at = 0
        self._writer.start(profile="", library="drivelesson")
        self._writer.add_metadata(RUN, dict(run))
        if model_before is not None:
            self._attach(MODEL_BEFORE, model_before)
        self._written.take()
        self.flush()

    @property
    def frames(self) -> int:
        """Number of pictures written."""
        return self.tally.frames

    @property
    def bytes_written(self) -> int:
        return self._written.tell()

    def write_frame(self, frame: Frame) -> None:
        """Add one picture in the encoding in which the camera delivered it. The message's number is
        the frame's id."""
        stamp_ns = self._to_ns(frame.captured_s)
        data = encode_image(frame, stamp_ns)
        self.tally.note_frame(frame.frame_id)
        self._add(camera_channel(frame), stamp_ns, data, frame.frame_id)

    def write_message(self, topic: Topic, now_s: float, fields: Fields) -> None:
        stamp_ns = self._to_ns(now_s)
        if topic == Topic.LESSON:
            self.tally.note(read_event(fields))
        self._add(json_channel(topic), stamp_ns, to_json(fields))
        if topic == Topic.SENSORS and fields["pose"]:
            self._add(pose_channel(), stamp_ns, encode_pose(fields["pose"], stamp_ns))

    def write_lesson(self, now_s: float, event: HistoryEvent) -> None:
        """Add a change of the learner, and count its examples."""
        self.tally.note(event)
        self._add(json_channel(Topic.LESSON), self._to_ns(now_s), to_json(describe_event(event)))

    def write_copy(self, record: Message | Metadata | Attachment) -> None:
        """Add a record of another recording, byte for byte."""
        if isinstance(record, Metadata):
            self._writer.add_metadata(record.name, record.values)
        elif isinstance(record, Attachment):
            if record.name != INDEX:
                self._attach(record.name, record.data)
        else:
            if record.topic == Topic.CAMERA:
                self.tally.note_frame(record.sequence)
            elif record.topic == Topic.LESSON:
                self.tally.note(read_event(json.loads(record.data)))
            self._add(record.channel, record.log_ns, record.data, record.sequence)

    def flush(self) -> None:
        """Flush to the disk, so that a kill or a power cut does not lose what was written so
        far."""
        self._writer.flush()
        self._follow()
        _sync(self._file)

    def close(self, summary: Mapping[str, str], model_after: bytes | None = None) -> None:
        """Write the end: attachments, summary and index; then close the file."""
        try:
            self._writer.flush()
            self._follow()
            self._write_index(is_last=True)
            if model_after is not None:
                self._attach(MODEL_AFTER, model_after)
            lasted_s = (self.tally.last_ns - self.tally.first_ns) / 1e9
            content = describe_content(self.frames, self.tally.taught, lasted_s)
            self._writer.add_metadata(SUMMARY, {**content, **summary})
            self._writer.finish()
            self._file.flush()
            _sync(self._file)
        finally:
            self._file.close()

    def _follow(self) -> None:
        """Add the written chunks to the index; write the index section once it is large."""
        offset, data = self._written.take()
        if self._columns is None:
            return
        try:
            for block in self._follower.blocks(data, offset):
                self._columns.add(block)
        except UNREADABLE:
            # without an index, a reader checks every message and reports the damaged one
            self._columns = None
            return
        if self._columns.pictures >= self._section_frames:
            self._write_index(is_last=False)

    def _write_index(self, *, is_last: bool) -> None:
        """Write the index of the chunks since the last section."""
        if self._columns is None:
            return
        self._writer.flush()
        at, channels = self._written.tell(), self._follower.channels
        section = encode(self._columns, channels, at, self._section_at, is_last=is_last)
        self._attach(INDEX, section)
        self._section_at, self._columns = at, Columns(self._origin_ns)
        self._written.take()

    def abandon(self) -> None:
        """Close the file without completing it."""
        self._file.close()

    def _attach(self, name: str, data: bytes) -> None:
        stamp_ns = self.tally.last_ns or self._began_ns
        self._writer.add_attachment(stamp_ns, stamp_ns, name, "application/zip", data)

    def _to_ns(self, now_s: float) -> int:
        """Return a time of the run's clock as nanoseconds since 1970."""
        return max(self._origin_ns + round(now_s * 1e9), 0)

    def _add(self, channel: MessageChannel, stamp_ns: int, data: bytes, sequence: int = 0) -> None:
        self.tally.note_time(stamp_ns)
        self._writer.add_message(self._channel(channel), stamp_ns, data, stamp_ns, sequence)
        if self._written.waiting:
            self._follow()

    def _register(self, channel: MessageChannel) -> int:
        topic, encoding, schema, metadata = channel
        number: int = self._writer.register_channel(
            topic, encoding, self._schema(schema), dict(metadata)
        )
        return number


class _Written:
    """A file for writing that also keeps the written bytes until `take` returns them."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._offset, self._data = 0, bytearray()
        self.tell, self.flush = file.tell, file.flush

    @property
    def waiting(self) -> int:
        """Number of bytes that are buffered."""
        return len(self._data)

    def write(self, data: bytes) -> int:
        self._data += data
        return self._file.write(data)

    def take(self) -> tuple[int, bytes]:
        """Return the offset and the bytes that were written since the last call."""
        offset, data = self._offset, bytes(self._data)
        self._data.clear()
        self._offset += len(data)
        return offset, data


def _sync(file: BinaryIO) -> None:
    """Flush the file's bytes to the disk, if it is a real file."""
    with contextlib.suppress(io.UnsupportedOperation):
        os.fsync(file.fileno())
