"""Serializes changes of the learner, for recordings and for the journal."""

from __future__ import annotations

import base64
import binascii
import json
from typing import Any

import numpy as np

from robot.errors import UNREADABLE, RecordingError, told_as
from robot.learner.base import Vector
from robot.policy.history import Edited, HistoryEvent, Replaced, Taught, Undone
from robot.types import Action, Example, Point

PlainEvent = dict[str, Any]


def describe_event(event: HistoryEvent, *, with_vector: bool = True) -> PlainEvent:
    """Describe one change of the learner. Without `with_vector` the vector of an example is
    omitted, because its frame is recorded."""
    if isinstance(event, Taught):
        example = event.example
        return {
            "event": "taught",
            "frame": example.frame_id,
            "label": example.label,
            "intervention": example.is_intervention,
            **describe_point(example.point),
            "at_s": event.at_s,
            "x": _describe_vector(event.x) if with_vector and event.x.size else None,
        }
    if isinstance(event, Edited):
        return {
            "event": "edited",
            "verb": event.verb,
            "node": event.node_id,
            "value": event.value,
            "at_s": event.at_s,
        }
    if isinstance(event, Undone):
        return {"event": "undone", "frames": list(event.frame_ids)}
    return {"event": "replaced", "learner": event.policy_name}


def read_event(plain: PlainEvent) -> HistoryEvent:
    """Read a description of `describe_event`; a vector that was omitted is empty."""
    with told_as(RecordingError, "an example is damaged", *UNREADABLE):
        kind = plain["event"]
        if kind == "taught":
            x = _read_vector(plain["x"]) if plain.get("x") else np.zeros(0)
            example = Example(
                frame_id=int(plain["frame"]),
                label=Action(plain["label"]),
                is_intervention=bool(plain["intervention"]),
                point=read_point(plain),
            )
            at_s = float(plain["at_s"])
            return Taught(example=example, x=x, at_s=at_s)
        if kind == "edited":
            return Edited(
                verb=str(plain["verb"]),
                node_id=int(plain["node"]),
                value=plain["value"],
                at_s=float(plain["at_s"]),
            )
        if kind == "undone":
            return Undone(frame_ids=tuple(int(frame) for frame in plain["frames"]))
        if kind == "replaced":
            return Replaced(policy_name=str(plain["learner"]))
        raise ValueError(f"unknown event {kind!r}")


def to_plain(value: Any) -> Any:
    """Convert a NumPy value to a plain value that JSON can represent."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"cannot serialize a {type(value).__name__}")


_encode = json.JSONEncoder(separators=(",", ":"), default=to_plain).encode


def to_json(fields: PlainEvent) -> bytes:
    """Return the fields as JSON. The fields must not contain infinite numbers, which JSON cannot
    represent."""
    return _encode(fields).encode()


def _describe_vector(x: Vector) -> PlainEvent:
    data = base64.b64encode(np.ascontiguousarray(x).tobytes()).decode()
    return {"dtype": x.dtype.str, "shape": list(x.shape), "data": data}


def _read_vector(plain: PlainEvent) -> Vector:
    dtype = np.dtype(str(plain["dtype"]))
    if dtype.kind not in "fiu":
        raise ValueError(f"a vector must hold numbers, not {dtype}")
    with told_as(ValueError, "a vector is damaged", binascii.Error):
        raw = base64.b64decode(plain["data"], validate=True)
    return np.frombuffer(raw, dtype).reshape([int(size) for size in plain["shape"]])


def describe_point(point: Point | None) -> PlainEvent:
    """Return a point as fields; empty if there is no point."""
    return {} if point is None else point._asdict()


def read_point(plain: PlainEvent) -> Point | None:
    """Read the fields of `describe_point`; raises RecordingError if a field is missing or out of
    range."""
    numbers = [plain.get(name) for name in Point._fields]
    if numbers == [None, None]:
        return None
    shares = [float(n) for n in numbers if isinstance(n, int | float) and -1.0 <= n <= 1.0]
    if len(shares) < len(numbers):
        raise RecordingError(f"a recorded point is damaged: {numbers}")
    return Point(*shares)
