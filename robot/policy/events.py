"""The changes of a learner, and their form in the journal and in recordings."""

from __future__ import annotations

import base64
import binascii
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot.errors import UNREADABLE, RecordingError, told_as
from robot.learner.base import Vector
from robot.types import Action, Example, Point

PlainEvent = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Taught:
    """One example, with its vector and its teaching time."""

    example: Example
    x: Vector
    at_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edited:
    """One change that a person made. `relabel`, `delete` and `pin` change one learned image.
    `outdate` marks all earlier examples as out of date. `alike` states that left and right are
    alike here. For `outdate` and `alike` the `node_id` is 0."""

    verb: str
    node_id: int
    value: Any
    at_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Undone:
    """An undo of the examples of `frame_ids`, or of the latest edit if `frame_ids` is empty."""

    frame_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Replaced:
    """A loaded model, or a policy of another size, replaced the policy."""

    policy_name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveBegun:
    """A drive began between two examples, so the policy was reset: it forgot the state of the last
    drive."""

    at_s: float


LogEvent = Taught | Edited | DriveBegun
"""Events that change a learner: replaying them in order yields the same learner, bit for bit."""
HistoryEvent = Taught | Edited | Undone | Replaced


def describe_event(event: HistoryEvent, *, with_vector: bool = True) -> PlainEvent:
    """Describe one change of the learner. If the frame of an example is recorded, its vector can be
    omitted (`with_vector`)."""
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
        edit = {"verb": event.verb, "node": event.node_id, "value": event.value}
        return {"event": "edited", **edit, "at_s": event.at_s}
    if isinstance(event, Undone):
        return {"event": "undone", "frames": list(event.frame_ids)}
    return {"event": "replaced", "learner": event.policy_name}


def read_event(plain: PlainEvent) -> HistoryEvent:
    """Return the event that `describe_event` described; `x` is empty if the vector is missing."""
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
            verb, node_id = str(plain["verb"]), int(plain["node"])
            at_s = float(plain["at_s"])
            return Edited(verb=verb, node_id=node_id, value=plain["value"], at_s=at_s)
        if kind == "undone":
            return Undone(frame_ids=tuple(int(frame) for frame in plain["frames"]))
        if kind == "replaced":
            return Replaced(policy_name=str(plain["learner"]))
        raise ValueError(f"unknown event {kind!r}")


def to_plain(value: Any) -> Any:
    """Convert a NumPy value to plain numbers for JSON; raises TypeError for other types."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"cannot serialize a {type(value).__name__}")


_encode = json.JSONEncoder(separators=(",", ":"), default=to_plain).encode


def to_json(fields: PlainEvent) -> bytes:
    """Return the fields as JSON. Raises ValueError for numbers that are not finite, which JSON
    cannot represent."""
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
    """Read the fields of `describe_point`; raises RecordingError if a field is invalid."""
    numbers = [plain.get(name) for name in Point._fields]
    if numbers == [None, None]:
        return None
    shares = [float(n) for n in numbers if isinstance(n, int | float) and -1.0 <= n <= 1.0]
    if len(shares) < len(numbers):
        raise RecordingError(f"a recorded point is damaged: {numbers}")
    return Point(*shares)
