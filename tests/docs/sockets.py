"""Writes docs/reference/asyncapi.json, which describes the two sockets for programs, from the types
in the code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robot.control.link_governor import LinkLevel
from robot.types import DrivenBy, Mode, Point, StopReason
from server.protocol import (
    ACKNOWLEDGEMENT,
    FRAME_HEADER,
    PROTOCOL_VERSION,
    BareMessage,
    DriveMessage,
    ErrorCode,
    ModeMessage,
    Ping,
    ReleaseMessage,
    _numbers_of,
)

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "asyncapi.json"
Schema = dict[str, Any]
_TEXT, _NUMBER, _TRUTH = {"type": "string"}, {"type": "number"}, {"type": "boolean"}
_COUNT = {"type": "integer", "minimum": 0}
_POINT = {name: {"type": "number", "minimum": -1, "maximum": 1} for name in Point._fields}
_MOVE = {"type": "string", "pattern": "^[a-z][a-z0-9_]{0,31}$"}


def maybe(schema: Schema) -> Schema:
    """Allow null as well."""
    if "enum" in schema:
        return {"enum": [*schema["enum"], None]}
    return {**schema, "type": [schema["type"], "null"]}


def one_of(words: Any) -> Schema:
    """Allow the words of an enumeration."""
    return {"enum": [str(word) for word in words]}


def numbers_of(kind: type[Any]) -> tuple[Schema, list[str]]:
    """Return the numbers that a message declares, and the required ones among them."""
    schemas, required = {}, []
    for name, is_optional, types, least, most, _ in _numbers_of(kind):
        plain = {"type": "integer" if types == (int,) else "number"}
        limited = {**plain, "minimum": least, "maximum": most}
        schemas[name] = maybe(limited) if is_optional else limited
        required += [] if is_optional else [name]
    return schemas, required


def message(kind: str, fields: Schema, required: list[str] | None = None) -> Schema:
    """Return the schema of a message; later versions may add fields."""
    needed = list(fields) if required is None else required
    properties = {"type": {"const": kind}, **fields}
    return {"type": "object", "properties": properties, "required": ["type", *needed]}


def upward() -> dict[str, Schema]:
    """Return the messages that a page sends on `/ws/drive`."""
    drive, needed = numbers_of(DriveMessage)
    mode, mode_needs = numbers_of(ModeMessage)
    ping, ping_needs = numbers_of(Ping)
    release, release_needs = numbers_of(ReleaseMessage)
    return {
        "drive": message("drive", {"held": maybe(_MOVE), **drive}, needed)
        | {"anyOf": by_degrees()},
        "mode": message("mode", {"mode": one_of(Mode), **mode}, ["mode", *mode_needs]),
        "ping": message("ping", ping, ping_needs),
        "release": message("release", release, release_needs),
        **{kind.value: message(kind.value, {}) for kind in BareMessage},
    }


def by_degrees() -> list[Schema]:
    """Return the two forms of `drive`: a plain move, or a move by degrees."""
    nothing, number = {"type": "null"}, {"type": "number"}
    names = Point._fields
    return [
        {"properties": dict.fromkeys(names, nothing)},
        {
            "properties": {"held": {"type": "string"}, **dict.fromkeys(names, number)},
            "required": ["held", *names],
        },
    ]


def downward() -> dict[str, Schema]:
    """Return the messages that the server sends on `/ws/drive`."""
    prediction = {
        "frame": _COUNT,
        "action": maybe(_TEXT),
        "confidence": _NUMBER,
        "novelty": _NUMBER,
        "probabilities": {"type": "object", "additionalProperties": _NUMBER},
        "node": maybe(_COUNT),
        "distance": _NUMBER,
        "point": maybe(whole(_POINT)),
        "spread": maybe(_NUMBER),
    }
    camera = {
        "period_ms": _NUMBER,
        "age_ms": _NUMBER,
        "brick_ms": maybe(_NUMBER),
        "limit_ms": _NUMBER,
        "speed_scale": _NUMBER,
    }
    pose = {"x_m": _NUMBER, "y_m": _NUMBER, "heading_rad": _NUMBER, "is_estimate": _TRUTH}
    state = {
        "server_ms": _NUMBER,
        "mode": one_of(Mode),
        "driven_by": one_of(DrivenBy),
        "action": _TEXT,
        "point": maybe(whole(_POINT)),
        "speed_scale": _NUMBER,
        "stop_reason": maybe(one_of(StopReason)),
        "emergency": _TRUTH,
        "stop_held_by": maybe(_TEXT),
        "stop_number": _COUNT,
        "asks_pilot": _TRUTH,
        "fault": maybe(_TEXT),
        "pilot": maybe(_TEXT),
        "wheel_asked": _TRUTH,
        "you_are_pilot": _TRUTH,
        "viewers": _COUNT,
        "frame": maybe(_COUNT),
        "frame_age_ms": maybe(_NUMBER),
        "cycle_hz": _NUMBER,
        "link": one_of(LinkLevel),
        "busy": _TRUTH,
        "pilot_frame_age_ms": maybe(_NUMBER),
        "nonce": maybe(_COUNT),
        "camera": whole(camera),
        "prediction": maybe(whole(prediction)),
        "agreement": maybe(_NUMBER),
        "agreement_frames": _COUNT,
        "taught": {"type": "object", "additionalProperties": _COUNT},
        "lessons": _COUNT,
        "nodes": _COUNT,
        "max_nodes": _COUNT,
        "learner": _TEXT,
        "distance_m": maybe(_NUMBER),
        "bumped": maybe(_TRUTH),
        "bumpers": {"type": "array", "items": _TRUTH},
        "battery": maybe(_NUMBER),
        "pose": maybe(whole(pose)),
    }
    hello = {
        "protocol": {"const": PROTOCOL_VERSION},
        "client": _TEXT,
        "role": {"enum": ["pilot", "viewer"]},
        "robot": _TEXT,
        "moves": {"type": "array", "items": _MOVE},
        "declared_moves": {"type": "array", "items": {"type": "object"}},
        "takes_points": _TRUTH,
        "server_ms": _NUMBER,
    }
    error = {"code": one_of(ErrorCode), "message": _TEXT}
    return {
        "hello": message("hello", hello),
        "state": message("state", state),
        "pong": message("pong", {"client_ms": _NUMBER, "server_ms": _NUMBER}),
        "error": message("error", error),
        "event": message("event", {"name": _TEXT}),
    }


def whole(fields: Schema) -> Schema:
    """Return an object with all of these fields."""
    return {"type": "object", "properties": fields, "required": list(fields)}


def describe() -> Schema:
    """Return the whole description."""
    schemas = {
        f"{way}.{name}": schema for way, found in _ways().items() for name, schema in found.items()
    }
    named = {name: {"payload": {"$ref": f"#/components/schemas/{name}"}} for name in schemas}
    binary = {
        "down.frame": f"{FRAME_HEADER.size} bytes of header, then a picture: see protocol.md",
        "up.acknowledgement": f"{ACKNOWLEDGEMENT.size} bytes: see protocol.md",
    }
    named |= {
        name: {"contentType": "application/octet-stream", "summary": text}
        for name, text in binary.items()
    }
    channels = {"drive": list(schemas), "video": list(binary)}
    return {
        "asyncapi": "3.0.0",
        "info": {"title": "Drivelesson", "version": str(PROTOCOL_VERSION)},
        "defaultContentType": "application/json",
        "channels": {
            channel: {
                "address": f"/ws/{channel}",
                "messages": {n: {"$ref": f"#/components/messages/{n}"} for n in names},
            }
            for channel, names in channels.items()
        },
        "operations": {
            f"{channel}.{way}": {
                "action": action,
                "channel": {"$ref": f"#/channels/{channel}"},
                "messages": [
                    {"$ref": f"#/channels/{channel}/messages/{name}"}
                    for name in names
                    if name.startswith(way)
                ],
            }
            for channel, names in channels.items()
            for way, action in (("up", "receive"), ("down", "send"))
        },
        "components": {"schemas": schemas, "messages": named},
    }


def _ways() -> dict[str, dict[str, Schema]]:
    return {"up": upward(), "down": downward()}


def render() -> str:
    """Return the file's text."""
    return json.dumps(describe(), indent=2) + "\n"
