"""One recording on its way to the disk: an MCAP file that is readable up to its last flush."""

from __future__ import annotations

import io
import json
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from robot.driver import Move, to_text
from robot.store.episodes.images import encode_image, image_schema, schema_name
from robot.store.episodes.messages import CAMERA, DECISION, LESSON, SCHEMAS, Fields, to_json
from robot.store.episodes.reader import Message, require_mcap
from robot.types import Action, Frame

FORMAT = 1
RUN, SUMMARY = "drivelesson.run", "drivelesson.summary"
"""Names of the metadata records at the beginning and at the end."""
MODEL_BEFORE, MODEL_AFTER = "model_before.npz", "model_after.npz"
"""Names of the attachments: what the learner knew at the beginning and at the end."""
_CHUNK_BYTES = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What is known of a recording when it begins.

    `started_at_s` is wall-clock time, seconds since 1970. `origin_ns` is what the run's clock
    showed as 0, in nanoseconds since 1970. Frame ids are unique within one `run_id`: several
    recordings of one run of the program share it.
    """

    episode_id: str
    run_id: str
    origin_ns: int
    started_at_s: float = 0.0
    robot: str = ""
    learner: str = ""
    moves: tuple[str, ...] = ()
    declared_moves: tuple[Move, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    source: str = "drive"

    def to_ns(self, now_s: float) -> int:
        """Return a time of the run's clock as nanoseconds since 1970."""
        return self.origin_ns + round(now_s * 1e9)


class EpisodeWriter:
    """Writes one MCAP file. For one thread; raises OSError when the disk refuses.

    Args:
        file: The target; seekable or not, opened for binary writing. Closed by `close`.
        run: What is known already.
        model_before: A model's file, or None for a learner that knows nothing.

    Raises:
        MissingExtraError: If the library `mcap` is not installed.
    """

    def __init__(self, file: BinaryIO, run: Run, model_before: bytes | None = None) -> None:
        self._file = file
        self._run = run
        self._writer = _make_writer(file)
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[Any, ...], int] = {}
        self.frames = 0
        self.has_content = False
        """Whether the robot moved or the learner changed: otherwise the recording is discarded."""
        self._labels: dict[int, str] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._writer.start(profile="", library="drivelesson")
        self._writer.add_metadata(RUN, self._describe_run())
        if model_before is not None:
            self._attach(MODEL_BEFORE, model_before)
        self.flush()

    def _describe_run(self) -> dict[str, str]:
        run = self._run
        return {
            "format": str(FORMAT),
            "episode": run.episode_id,
            "run": run.run_id,
            "origin_ns": str(run.origin_ns),
            "started_at_s": f"{run.started_at_s:.3f}",
            "robot": run.robot,
            "learner": run.learner,
            "moves": ",".join(run.moves),
            "declared_moves": to_text(run.declared_moves),
            "options": json.dumps(dict(run.options), default=str),
            "source": run.source,
            "timed": "1",  # examples were learned with their teaching times, unlike in 0.1
        }

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message."""
        return 0.0 if self._first_ns is None else (self._last_ns - self._first_ns) / 1e9

    def write_frame(self, frame: Frame) -> None:
        """Add one picture as the camera gave it; its id is the message's sequence number."""
        stamp_ns = self._run.to_ns(frame.captured_s)
        channel = self._camera_channel(frame)
        self._add(channel, stamp_ns, encode_image(frame, stamp_ns), frame.frame_id)
        self.frames += 1

    def write_message(self, topic: str, now_s: float, fields: Fields) -> None:
        """Add one message; its topic is one of `messages.SCHEMAS`."""
        if topic == LESSON:
            self._note_event(fields)
        elif topic == DECISION and fields["sent"] != Action.STOP:
            self.has_content = True
        self._add(self._json_channel(topic), self._run.to_ns(now_s), to_json(fields), 0)

    def _note_event(self, fields: Fields) -> None:
        self.has_content = True
        if fields["event"] == "taught":
            self._labels[int(fields["frame"])] = str(fields["label"])
        elif fields["event"] == "undone":
            for frame_id in fields["frames"]:
                self._labels.pop(int(frame_id), None)

    @property
    def taught(self) -> Counter[str]:
        """How many frames were taught each move, without those that were undone."""
        return Counter(self._labels.values())

    def write_copy(self, message: Message) -> None:
        """Add a message of another recording, byte for byte."""
        if message.topic == CAMERA:
            self.frames += 1
            size = message.channel_metadata
            channel = self._image_channel(
                message.schema, size.get("width", "0"), size.get("height", "0")
            )
        else:
            channel = self._json_channel(message.topic)
        self._add(channel, message.log_ns, message.data, message.sequence)

    def flush(self) -> None:
        """Flush to the disk: a kill or a power cut then loses nothing of it."""
        self._writer.flush()
        _sync(self._file)

    def close(self, summary: Mapping[str, str], model_after: bytes | None = None) -> None:
        """Write the end: attachments, summary and index; then close the file."""
        try:
            if model_after is not None:
                self._attach(MODEL_AFTER, model_after)
            self._writer.add_metadata(
                SUMMARY,
                {
                    "frames": str(self.frames),
                    "taught": json.dumps(self.taught),
                    "duration_s": f"{self.duration_s:.3f}",
                    **summary,
                },
            )
            self._writer.finish()
            self._file.flush()
            _sync(self._file)
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is, after the disk refused."""
        self._file.close()

    def _attach(self, name: str, data: bytes) -> None:
        stamp_ns = self._last_ns or round(self._run.started_at_s * 1e9)
        self._writer.add_attachment(stamp_ns, stamp_ns, name, "application/zip", data)

    def _add(self, channel: int, stamp_ns: int, data: bytes, sequence: int) -> None:
        stamp_ns = max(stamp_ns, 0)
        self._first_ns = stamp_ns if self._first_ns is None else min(self._first_ns, stamp_ns)
        self._last_ns = max(self._last_ns, stamp_ns)
        self._writer.add_message(channel, stamp_ns, data, stamp_ns, sequence)

    def _camera_channel(self, frame: Frame) -> int:
        return self._image_channel(schema_name(frame), str(frame.width), str(frame.height))

    def _image_channel(self, name: str, width: str, height: str) -> int:
        key = (name, width, height)
        if key not in self._channels:
            schema = self._schema(name, "protobuf", image_schema(name))
            size = {"width": width, "height": height}
            self._channels[key] = self._writer.register_channel(CAMERA, "protobuf", schema, size)
        return self._channels[key]

    def _json_channel(self, topic: str) -> int:
        if (topic,) not in self._channels:
            described = SCHEMAS[topic]
            schema = self._schema(described["title"], "jsonschema", to_json(described))
            self._channels[(topic,)] = self._writer.register_channel(topic, "json", schema)
        return self._channels[(topic,)]

    def _schema(self, name: str, encoding: str, data: bytes) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, encoding, data)
        return self._schemas[name]


def _sync(file: BinaryIO) -> None:
    """Have the file's bytes reach the disk, if it is a real file."""
    try:
        descriptor = file.fileno()
    except io.UnsupportedOperation:
        return
    os.fsync(descriptor)


def _make_writer(file: BinaryIO) -> Any:
    require_mcap()
    from mcap.writer import CompressionType, Writer

    return Writer(file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
