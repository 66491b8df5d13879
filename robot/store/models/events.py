"""Serializes changes of the learner, for recordings and for the journal."""

from __future__ import annotations

import base64
import binascii
import json
from typing import Any

import numpy as np

from robot.errors import RecordingError
from robot.learner.base import Vector
from robot.policy.history import Edited, HistoryEvent, Replaced, Taught, Undone
from robot.types import Action, Example

PlainEvent = dict[str, Any]


def describe_event(event: HistoryEvent, *, with_vector: bool = False) -> PlainEvent:
    """Describe one change of the learner; with its vector if its frame is not recorded."""
    if isinstance(event, Taught):
        example = event.example
        return {
            "event": "taught",
            "frame": example.frame_id,
            "label": example.label,
            "intervention": example.is_intervention,
            "at_s": event.at_s,
            "x": _describe_vector(event.x) if with_vector else None,
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


def read_event(plain: PlainEvent) -> tuple[HistoryEvent, Vector | None]:
    """Read a change of the learner back, and the vector if it was recorded.

    Raises:
        RecordingError: If the values have another form.
    """
    try:
        kind = plain["event"]
        if kind == "taught":
            x = _read_vector(plain["x"]) if plain.get("x") else None
            example = Example(
                frame_id=int(plain["frame"]),
                label=Action(plain["label"]),
                is_intervention=bool(plain["intervention"]),
            )
            at_s = float(plain["at_s"])
            return Taught(example=example, x=np.zeros(0) if x is None else x, at_s=at_s), x
        if kind == "edited":
            edited = Edited(
                verb=str(plain["verb"]),
                node_id=int(plain["node"]),
                value=plain["value"],
                at_s=float(plain["at_s"]),
            )
            return edited, None
        if kind == "undone":
            return Undone(frame_ids=tuple(int(frame) for frame in plain["frames"])), None
        if kind == "replaced":
            return Replaced(policy_name=str(plain["learner"])), None
        raise ValueError(f"unknown event {kind!r}")
    except (KeyError, ValueError, TypeError) as error:
        raise RecordingError(f"an example is damaged: {error}") from error


def to_json(fields: PlainEvent) -> bytes:
    """Return the fields as JSON; they must not hold infinite numbers, which JSON cannot express."""
    return json.dumps(fields, separators=(",", ":"), default=_plain).encode()


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"cannot keep a {type(value).__name__}")


def _describe_vector(x: Vector) -> PlainEvent:
    data = base64.b64encode(np.ascontiguousarray(x).tobytes()).decode()
    return {"dtype": x.dtype.str, "shape": list(x.shape), "data": data}


def _read_vector(plain: PlainEvent) -> Vector:
    dtype = np.dtype(str(plain["dtype"]))
    if dtype.kind not in "fiu":
        raise ValueError(f"a vector of {dtype}")
    try:
        raw = base64.b64decode(plain["data"], validate=True)
    except binascii.Error as error:
        raise ValueError(f"a vector is damaged: {error}") from error
    return np.frombuffer(raw, dtype).reshape([int(size) for size in plain["shape"]])
