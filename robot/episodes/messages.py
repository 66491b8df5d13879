"""What a recording says besides its pictures: the topics, their schemas, and lessons as words.

Times of messages are in MCAP's own log time; what is here needs none of its own.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from robot.errors import RecordingError
from robot.learner.base import Vector
from robot.policy.history import Edited, HistoryEvent, Replaced, Taught, Undone
from robot.types import Action, Example, PilotCommand, Prediction, Sensors

CAMERA = "/camera"
COMMAND = "/command"
DECISION = "/decision"
PREDICTION = "/prediction"
SENSORS = "/sensors"
MODE = "/mode"
LESSON = "/lesson"

Words = dict[str, Any]

_TEXT = {"type": "string"}
_MAYBE_TEXT = {"type": ["string", "null"]}
_NUMBER = {"type": "number"}
_MAYBE_NUMBER = {"type": ["number", "null"]}
_COUNT = {"type": "integer", "minimum": 0}
_MAYBE_COUNT = {"type": ["integer", "null"], "minimum": 0}
_TRUTH = {"type": "boolean"}
_MAYBE_TRUTH = {"type": ["boolean", "null"]}


def _schema(title: str, required: Mapping[str, Any], **optional: Any) -> Words:
    return {
        "title": f"drivelesson.{title}",
        "type": "object",
        "properties": {**required, **optional},
        "required": list(required),
    }


SCHEMAS: dict[str, Words] = {
    COMMAND: _schema(
        "Command",
        {"held": _MAYBE_TEXT, "frame": _MAYBE_COUNT, "seq": _COUNT, "pilot": _TEXT},
    ),
    DECISION: _schema(
        "Decision",
        {
            "action": _TEXT,
            "sent": _TEXT,
            "driven_by": _TEXT,
            "mode": _TEXT,
            "speed_scale": _NUMBER,
            "stop_reason": _MAYBE_TEXT,
            "asks_pilot": _TRUTH,
            "cycle_ms": _NUMBER,
        },
    ),
    PREDICTION: _schema(
        "Prediction",
        {
            "frame": _COUNT,
            "action": _MAYBE_TEXT,
            "confidence": _NUMBER,
            "novelty": _NUMBER,
            "probabilities": {"type": "object", "additionalProperties": _NUMBER},
            "node": _MAYBE_COUNT,
            "distance": _NUMBER,
        },
    ),
    SENSORS: _schema(
        "Sensors",
        {
            "distance_m": _MAYBE_NUMBER,
            "bumped": _MAYBE_TRUTH,
            "battery": _MAYBE_NUMBER,
            "pose": {
                "type": ["object", "null"],
                "properties": {"x_m": _NUMBER, "y_m": _NUMBER, "heading_rad": _NUMBER},
            },
        },
    ),
    MODE: _schema("Mode", {"mode": _TEXT, "stop_reason": _MAYBE_TEXT}),
    LESSON: _schema(
        "Lesson",
        {"event": {"enum": ["taught", "edited", "undone", "replaced"]}},
        frame=_COUNT,
        label=_TEXT,
        intervention=_TRUTH,
        at_s=_NUMBER,
        x={"type": ["object", "null"]},
        verb=_TEXT,
        node=_COUNT,
        value={},
        frames={"type": "array", "items": _COUNT},
        learner=_TEXT,
    ),
}
"""Topic to JSON schema. /camera is Foxglove's own (robot/episodes/images.py)."""


def to_json(words: Words) -> bytes:
    """Return the words as JSON, where no number is infinite: JSON has none."""
    return json.dumps(words, separators=(",", ":"), default=_plain).encode()


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"cannot record a {type(value).__name__}")


def _finite(number: float) -> float:
    return float(number) if math.isfinite(number) else 1e300


def describe_command(command: PilotCommand) -> Words:
    """Describe one word of the pilot."""
    return {
        "held": command.held,
        "frame": command.frame_id,
        "seq": command.seq,
        "pilot": command.pilot,
    }


def describe_prediction(prediction: Prediction) -> Words:
    """Describe what the robot would have done."""
    return {
        "frame": prediction.frame_id,
        "action": prediction.action,
        "confidence": _finite(prediction.confidence),
        "novelty": _finite(prediction.novelty),
        "probabilities": {a: _finite(p) for a, p in prediction.probabilities.items()},
        "node": prediction.node,
        "distance": _finite(prediction.distance),
    }


def describe_sensors(sensors: Sensors) -> Words:
    """Describe what was sensed."""
    pose = sensors.pose
    return {
        "distance_m": None if sensors.distance_m is None else _finite(sensors.distance_m),
        "bumped": sensors.bumped,
        "battery": sensors.battery_share,
        "pose": pose and {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad},
    }


def describe_event(event: HistoryEvent, *, with_vector: bool = False) -> Words:
    """Describe one change of the learner; the vector goes along where its frame is not recorded."""
    if isinstance(event, Taught):
        lesson = event.lesson
        return {
            "event": "taught",
            "frame": lesson.frame_id,
            "label": lesson.label,
            "intervention": lesson.is_intervention,
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


def read_event(words: Words) -> tuple[HistoryEvent, Vector | None]:
    """Read a change of the learner back, and the vector if it was recorded.

    Raises:
        RecordingError: If the words have another form.
    """
    try:
        kind = words["event"]
        if kind == "taught":
            x = _read_vector(words["x"]) if words.get("x") else None
            lesson = Example(
                frame_id=int(words["frame"]),
                label=Action(words["label"]),
                is_intervention=bool(words["intervention"]),
            )
            at_s = float(words["at_s"])
            return Taught(lesson=lesson, x=np.zeros(0) if x is None else x, at_s=at_s), x
        if kind == "edited":
            edited = Edited(
                verb=str(words["verb"]),
                node_id=int(words["node"]),
                value=words["value"],
                at_s=float(words["at_s"]),
            )
            return edited, None
        if kind == "undone":
            return Undone(frame_ids=tuple(int(frame) for frame in words["frames"])), None
        if kind == "replaced":
            return Replaced(policy_name=str(words["learner"])), None
        raise ValueError(f"an unknown event {kind!r}")
    except (KeyError, ValueError, TypeError) as error:
        raise RecordingError(f"a lesson is damaged: {error}") from error


def _describe_vector(x: Vector) -> Words:
    data = base64.b64encode(np.ascontiguousarray(x).tobytes()).decode()
    return {"dtype": x.dtype.str, "shape": list(x.shape), "data": data}


def _read_vector(words: Words) -> Vector:
    dtype = np.dtype(str(words["dtype"]))
    if dtype.kind not in "fiu":
        raise ValueError(f"a vector of {dtype}")
    try:
        raw = base64.b64decode(words["data"], validate=True)
    except binascii.Error as error:
        raise ValueError(f"a vector is damaged: {error}") from error
    return np.frombuffer(raw, dtype).reshape([int(size) for size in words["shape"]])
