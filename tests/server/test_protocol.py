from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from robot.moves import Move, move_at
from robot.types import DEFAULT_MOVES, Action, Encoding, Point
from server import protocol
from server.protocol import ProtocolError, VideoFrame

VECTORS: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "vectors" / "wire.json").read_text()
)


def _named(name: str) -> Any:
    vectors = VECTORS[name]
    return pytest.mark.parametrize(
        "vector", vectors, ids=[v.get("name", str(i)) for i, v in enumerate(vectors)]
    )


def _fields(message: protocol.ClientMessage) -> dict[str, Any]:
    return {} if isinstance(message, protocol.BareMessage) else asdict(message)


@_named("pictures")
def test_pictures(vector: dict[str, Any]) -> None:
    message = bytes.fromhex(vector["hex"])
    if "error" in vector:
        with pytest.raises(ProtocolError) as raised:
            protocol.parse_picture(message)
        assert raised.value.code == vector["error"]
        return
    fields = dict(vector["picture"])
    picture = VideoFrame(
        data=bytes.fromhex(fields.pop("data_hex")),
        captured_s=fields.pop("captured_ms") / 1000,
        encoding=Encoding(fields.pop("encoding")),
        **fields,
    )
    assert protocol.parse_picture(message) == picture
    encoded = protocol.encode_picture(picture, picture.nonce, is_quiet=picture.quiet)
    assert encoded == message


@_named("acknowledgements")
def test_every_acknowledgement_is_parsed(vector: dict[str, Any]) -> None:
    message = bytes.fromhex(vector["hex"])
    assert protocol.parse_acknowledgement(message) == vector["frame_id"]
    assert protocol.encode_acknowledgement(vector["frame_id"]) == message


@_named("refused_acknowledgements")
def test_every_invalid_acknowledgement_is_refused(vector: dict[str, Any]) -> None:
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_acknowledgement(bytes.fromhex(vector["hex"]))
    assert raised.value.code == vector["error"]


@_named("up")
def test_every_message_from_the_page_is_parsed(vector: dict[str, Any]) -> None:
    word = protocol.parse_message(json.dumps(vector), DEFAULT_MOVES, takes_points=True)
    wanted = {name: value for name, value in vector.items() if name != "type"}
    assert {name: value for name, value in _fields(word).items() if name in wanted} == wanted
    assert all(value is None for name, value in _fields(word).items() if name not in wanted)


@_named("refused_up")
def test_every_invalid_message_from_the_page_is_refused(vector: dict[str, Any]) -> None:
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_message(
            vector["text"], DEFAULT_MOVES, takes_points=vector.get("takes_points", True)
        )
    assert raised.value.code == vector["error"]


def test_a_refusal_names_the_seq_of_the_refused_message() -> None:
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_message('{"type":"drive","held":"up","seq":5}', DEFAULT_MOVES)
    assert json.loads(protocol.encode_error(raised.value))["seq"] == 5


POINTS: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "vectors" / "points.json").read_text()
)


@pytest.mark.parametrize("body", POINTS)
def test_a_point_counts_as_the_same_move_as_on_the_page(body: str) -> None:
    moves = [Move(Action(move.pop("name")), **move) for move in POINTS[body]["moves"]]
    for steering, throttle, wanted in POINTS[body]["points"]:
        assert move_at(Point(steering, throttle), moves) == wanted, (steering, throttle)
