"""Writes a drive of any length at once, whole, or truncated like by a power cut."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robot.recordings.messages import Topic
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.types import DEFAULT_MOVES
from tests.kit.frames import jpeg_frame

RATE_HZ = 30
ENDS = {"dropped_frames": "0", "lost_words": "0"}
_PICTURE_BYTES = 1900
"""The size of a JPEG of the simulator; its content does not matter."""


def begin(file: BinaryIO, model: bytes | None = None, **more: Any) -> EpisodeWriter:
    """Begin the recording of a robot in a new file, with the bytes of its model if there are any;
    `more` is for the writer."""
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


def teach(
    writer: EpisodeWriter, count: int, picture: Callable[[], bytes] = lambda: b"\xff\xd8" * 150
) -> None:
    """Write the recording of each picture that a robot is taught."""
    for number in range(1, count + 1):
        now_s, label = number / RATE_HZ, DEFAULT_MOVES[number // 40 % len(DEFAULT_MOVES)]
        said = {"frame": number, "action": label, "confidence": 0.9}
        drove = {"action": label, "sent": label, "driven_by": "pilot", "asks_pilot": False}
        taught = {"event": "taught", "frame": number, "label": label, "intervention": False}
        writer.write_frame(jpeg_frame(number, now_s, picture()))
        writer.write_message(Topic.SENSORS, now_s, {"distance_m": number / 1000, "pose": None})
        writer.write_message(Topic.PREDICTION, now_s, said)
        writer.write_message(Topic.DECISION, now_s, drove)
        writer.write_message(Topic.LESSON, now_s, taught | {"at_s": now_s, "x": None})


def write_cut_recording(path: Path, minutes: float) -> Path:
    """Write the recording of a robot that is taught with every picture, without its end."""
    rng = np.random.default_rng(1)
    with path.open("xb") as file:
        writer = begin(file)
        teach(writer, round(minutes * 60 * RATE_HZ), lambda: rng.bytes(_PICTURE_BYTES))
        writer.flush()
        file.truncate(file.tell() - 1000)
    return path
