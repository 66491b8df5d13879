"""Poses of the robot as messages that Foxglove and Rerun draw."""

from __future__ import annotations

import math

from robot.recordings.foxglove import POSE_IN_FRAME, message_type, schema_of
from robot.recordings.messages import Fields, Topic
from robot.recordings.reader import MessageChannel

_FLOOR = "floor"


def pose_channel() -> MessageChannel:
    return MessageChannel(Topic.POSE, "protobuf", schema_of(POSE_IN_FRAME))


def encode_pose(pose: Fields, stamp_ns: int) -> bytes:
    """Return a pose from the sensors as a message; `stamp_ns` is its time in nanoseconds since
    1970."""
    message = message_type(POSE_IN_FRAME)(frame_id=_FLOOR)
    message.timestamp.seconds, message.timestamp.nanos = divmod(stamp_ns, 10**9)
    half_rad = pose["heading_rad"] / 2
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y = pose["x_m"], pose["y_m"]
    turn.z, turn.w = math.sin(half_rad), math.cos(half_rad)
    data: bytes = message.SerializeToString()
    return data
