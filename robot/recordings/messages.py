"""The messages of a recording except pictures: their topics, schemas and fields.

The messages contain no time field, because a message's time is MCAP's log time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import asdict
from enum import StrEnum
from functools import cache
from typing import Any

from robot.control.state import Tick
from robot.driver import Game, Sensors
from robot.policy.events import HistoryEvent, Taught, describe_event, describe_point, to_json
from robot.recordings.reader import MessageChannel, Schema
from robot.types import Mode, PilotCommand, Point, Prediction


class Topic(StrEnum):
    """The topics of the messages."""

    CAMERA = "/camera"
    COMMAND = "/command"
    DECISION = "/decision"
    PREDICTION = "/prediction"
    SENSORS = "/sensors"
    POSE = "/pose"
    MODE = "/mode"
    LESSON = "/lesson"
    RESULT = "/result"


RUN, SUMMARY = "drivelesson.run", "drivelesson.summary"
"""Names of the metadata records at the beginning and at the end of a recording."""
PART = "part"
"""Key in the metadata at the beginning of a recording's later files: the number of the file, and
the counts of the files before it."""
CONTINUES = "continues"
"""Key in the metadata at the end of a file, if another file of the recording follows."""
EDITED = "edited"
"""Key in the metadata at the beginning of a recording, if its edits were applied to it. Edits of
learned images have no effect in such a recording."""
MODEL_BEFORE, MODEL_AFTER = "model_before.npz", "model_after.npz"
"""Names of the attachments: the learner's model at the beginning and at the end."""

Fields = dict[str, Any]
Messages = list[tuple[Topic, Fields]]

_TEXT = {"type": "string"}
_MAYBE_TEXT = {"type": ["string", "null"]}
_NUMBER = {"type": "number"}
_MAYBE_NUMBER = {"type": ["number", "null"]}
_COUNT = {"type": "integer", "minimum": 0}
_MAYBE_COUNT = {"type": ["integer", "null"], "minimum": 0}
_TRUTH = {"type": "boolean"}
_MAYBE_TRUTH = {"type": ["boolean", "null"]}
_SHARE = {"type": "number", "minimum": -1, "maximum": 1}


def _all(kind: Fields, *names: str) -> Fields:
    return dict.fromkeys(names, kind)


def _object(properties: Fields) -> Fields:
    return {"type": "object", "properties": properties}


def _schema(title: str, required: Fields, **optional: Any) -> Fields:
    return {
        "title": title,
        **_object({**required, **optional}),
        "required": list(required),
    }


_POINT = _all(_SHARE, *Point._fields)
_POSE = _object({**_all(_NUMBER, "x_m", "y_m", "heading_rad"), "is_estimate": _TRUTH})
_GAME = _object({**_all(_NUMBER, "score", "reward"), "number": _COUNT, "is_over": _TRUTH})

SCHEMAS: dict[Topic, Fields] = {
    Topic.COMMAND: _schema(
        "drivelesson.Command",
        {"held": _MAYBE_TEXT, "frame": _MAYBE_COUNT, "seq": _COUNT, "pilot": _TEXT},
        **_POINT,
    ),
    Topic.DECISION: _schema(
        "drivelesson.Decision",
        {
            **_all(_TEXT, "action", "sent", "driven_by", "mode"),
            **_all(_NUMBER, "speed_scale", "cycle_ms"),
            "stop_reason": _MAYBE_TEXT,
            "asks_pilot": _TRUTH,
        },
        **_POINT,
    ),
    Topic.PREDICTION: _schema(
        "drivelesson.Prediction",
        {
            **_all(_NUMBER, "confidence", "novelty", "distance"),
            "frame": _COUNT,
            "action": _MAYBE_TEXT,
            "probabilities": {"type": "object", "additionalProperties": _NUMBER},
            "node": _MAYBE_COUNT,
        },
        spread=_NUMBER,
        **_POINT,
    ),
    Topic.SENSORS: _schema(
        "drivelesson.Sensors",
        {
            **_all(_MAYBE_NUMBER, "distance_m", "battery"),
            "bumped": _MAYBE_TRUTH,
            "pose": {**_POSE, "type": ["object", "null"]},
        },
        game=_GAME,
    ),
    Topic.MODE: _schema("drivelesson.Mode", {"mode": _TEXT, "stop_reason": _MAYBE_TEXT}),
    Topic.LESSON: _schema(
        "drivelesson.Lesson",
        {"event": {"enum": ["taught", "edited", "undone", "replaced"]}},
        **_all(_COUNT, "frame", "node"),
        **_all(_TEXT, "label", "verb", "learner"),
        **_POINT,
        intervention=_TRUTH,
        at_s=_NUMBER,
        x={"type": ["object", "null"]},
        value={},
        frames={"type": "array", "items": _COUNT},
    ),
    Topic.RESULT: _schema("drivelesson.Result", {"of": _TEXT}),
}
"""JSON schema by topic. The messages of /camera and /pose are protobuf; see foxglove.py."""


@cache
def json_channel(topic: Topic) -> MessageChannel:
    schema = SCHEMAS[topic]
    return MessageChannel(topic, "json", Schema(schema["title"], "jsonschema", to_json(schema)))


def _finite(number: float) -> float:
    """Round to five digits: measurements are not more precise, and more digits waste disk space."""
    return float(f"{number:.5g}") if math.isfinite(number) else 1e300


def describe_tick(
    tick: Tick,
    events: Sequence[HistoryEvent],
    lost: Collection[int],
    *,
    is_shown: bool,
    is_begun: bool,
) -> Messages:
    """Return the messages of one tick.

    Args:
        events: The learner's changes, which are to be recorded.
        lost: Ids of taught frames whose pictures are not recorded. The feature vectors of these
            frames are recorded instead.
        is_shown: True if the recording contains the tick's picture.
        is_begun: True if the mode has changed since the last tick. The messages then name the new
            mode.
    """
    decision, seen = tick.decision, tick.prediction
    found: Messages = []
    if is_begun:
        now = {"mode": decision.mode, "stop_reason": decision.stop_reason}
        found.append((Topic.MODE, now))
    if is_shown:
        found.append((Topic.SENSORS, describe_sensors(tick.sensors)))
        if seen is not None and seen.frame_id == tick.frame_id:
            found.append((Topic.PREDICTION, describe_prediction(seen)))
    found += [(Topic.COMMAND, describe_command(command)) for command in tick.commands]
    if decision.mode is not Mode.STOPPED:
        found.append((Topic.DECISION, _describe_decision(tick)))
    for event in events:
        is_lost = isinstance(event, Taught) and event.example.frame_id in lost
        found.append((Topic.LESSON, describe_event(event, with_vector=is_lost)))
    return found


def _describe_decision(tick: Tick) -> Fields:
    decision = tick.decision
    return {
        "action": decision.action,
        "sent": tick.sent,
        "driven_by": decision.driven_by,
        "mode": decision.mode,
        "speed_scale": decision.speed_scale,
        "stop_reason": decision.stop_reason,
        "asks_pilot": decision.asks_pilot,
        "cycle_ms": round(tick.cycle_s * 1000, 4),
        **describe_point(decision.point),
    }


def describe_command(command: PilotCommand) -> Fields:
    return {
        "held": command.held,
        "frame": command.frame_id,
        "seq": command.seq,
        "pilot": command.pilot,
        **describe_point(command.point),
    }


def describe_prediction(prediction: Prediction) -> Fields:
    return {
        "frame": prediction.frame_id,
        "action": prediction.action,
        "confidence": _finite(prediction.confidence),
        "novelty": _finite(prediction.novelty),
        "probabilities": {a: _finite(p) for a, p in prediction.probabilities.items()},
        "node": prediction.node,
        "distance": _finite(prediction.distance),
        **({} if prediction.spread is None else {"spread": _finite(prediction.spread)}),
        **describe_point(prediction.point),
    }


def describe_sensors(sensors: Sensors) -> Fields:
    pose, game = sensors.pose, sensors.game
    return {
        "distance_m": None if sensors.distance_m is None else _finite(sensors.distance_m),
        "bumped": None if sensors.bumped is None else bool(sensors.bumped),
        "battery": sensors.battery_share,
        "pose": pose
        and {
            "x_m": _finite(pose.x_m),
            "y_m": _finite(pose.y_m),
            "heading_rad": _finite(pose.heading_rad),
            **({"is_estimate": True} if pose.is_estimate else {}),
        },
        **({} if game is None else {"game": _describe_game(game)}),
    }


def _describe_game(game: Game) -> Fields:
    return {**asdict(game), "score": _finite(game.score), "reward": _finite(game.reward)}
