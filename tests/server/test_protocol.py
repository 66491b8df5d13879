import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from robot.moves import Move, move_at
from robot.types import DEFAULT_MOVES, Action, Encoding, Point
from server import protocol
from server.protocol import ProtocolError, VideoFrame

VECTORS = Path(__file__).parents[1] / "vectors"
WIRE: dict[str, Any] = json.loads((VECTORS / "wire.json").read_text())
POINTS: dict[str, Any] = json.loads((VECTORS / "points.json").read_text())


def _each(*names: str) -> Any:
    vectors = [vector for name in names for vector in WIRE[name]]
    ids = [vector.get("name", str(number)) for number, vector in enumerate(vectors)]
    return pytest.mark.parametrize("vector", vectors, ids=ids)


def _check_refused(vector: dict[str, Any], parse: Callable[[], object]) -> None:
    with pytest.raises(ProtocolError) as raised:
        parse()
    assert raised.value.code == vector["error"]


@_each("pictures")
def test_every_picture_is_parsed_or_refused(vector):
    message = bytes.fromhex(vector["hex"])
    if "error" in vector:
        _check_refused(vector, lambda: protocol.parse_picture(message))
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


@_each("acknowledgements", "refused_acknowledgements")
def test_every_acknowledgement_is_parsed_or_refused(vector):
    message = bytes.fromhex(vector["hex"])
    if "error" in vector:
        _check_refused(vector, lambda: protocol.parse_acknowledgement(message))
    else:
        assert protocol.parse_acknowledgement(message) == vector["frame_id"]
        assert protocol.encode_acknowledgement(vector["frame_id"]) == message


@_each("up")
def test_every_message_from_the_page_is_parsed(vector):
    message = protocol.parse_message(json.dumps(vector), DEFAULT_MOVES, takes_points=True)
    fields = {} if isinstance(message, protocol.BareMessage) else asdict(message)
    wanted = {name: value for name, value in vector.items() if name != "type"}
    assert {name: value for name, value in fields.items() if name in wanted} == wanted
    assert all(value is None for name, value in fields.items() if name not in wanted)


@_each("refused_up")
def test_every_invalid_message_from_the_page_is_refused(vector):
    takes_points = vector.get("takes_points", True)
    _check_refused(
        vector,
        lambda: protocol.parse_message(vector["text"], DEFAULT_MOVES, takes_points=takes_points),
    )


def test_a_refusal_names_the_seq_of_the_refused_message():
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_message('{"type":"drive","held":"up","seq":5}', DEFAULT_MOVES)
    assert json.loads(protocol.encode_error(raised.value))["seq"] == 5


@pytest.mark.parametrize("body", POINTS)
def test_a_point_counts_as_the_same_move_as_on_the_page(body):
    moves = [Move(Action(move.pop("name")), **move) for move in POINTS[body]["moves"]]
    for steering, throttle, wanted in POINTS[body]["points"]:
        assert move_at(Point(steering, throttle), moves) == wanted, (steering, throttle)
