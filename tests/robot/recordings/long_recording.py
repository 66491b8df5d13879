"""Writes a drive of any length at once, and truncates it like a power cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robot.recordings.messages import Topic
from robot.recordings.writer import EpisodeWriter, describe_run
from robot.types import DEFAULT_MOVES
from tests.kit.frames import jpeg_frame

RATE_HZ = 30
_PICTURE_BYTES = 1900
"""The size of a JPEG of the simulator; its content does not matter."""


def write_cut_recording(path: Path, minutes: float) -> Path:
    """Write the recording of a robot that is taught with every picture, without its end."""
    rng = np.random.default_rng(1)
    run = describe_run(
        episode_id=path.stem,
        run_id="long",
        origin_ns=1_700_000_000 * 10**9,
        started_at_s=1_700_000_000.0,
        robot="sim",
        learner="default-32",
        moves=DEFAULT_MOVES,
    )
    decision = {
        "mode": "train",
        "driven_by": "pilot",
        "action": "forward",
        "sent": "forward",
        "speed_scale": 1.0,
        "stop_reason": None,
        "asks_pilot": False,
    }
    with path.open("xb") as file:
        writer = EpisodeWriter(file, run)
        for number in range(1, round(minutes * 60 * RATE_HZ) + 1):
            now_s = number / RATE_HZ
            label = DEFAULT_MOVES[number // 40 % len(DEFAULT_MOVES)]
            taught = {"event": "taught", "frame": number, "label": label, "intervention": False}
            writer.write_frame(jpeg_frame(number, now_s, rng.bytes(_PICTURE_BYTES)))
            writer.write_message(Topic.DECISION, now_s, decision | {"frame": number})
            writer.write_message(Topic.LESSON, now_s, taught | {"at_s": now_s, "x": None})
        writer.flush()
        file.truncate(file.tell() - 1000)
    return path
