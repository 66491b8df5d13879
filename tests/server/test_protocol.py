from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from robot.driver import Move, move_at
from robot.types import DEFAULT_MOVES, Action, Encoding, Point
from server import protocol
from server.protocol import ProtocolError, VideoFrame

from .virtual import ServedWorld, virtually

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


REFERENCE = (Path(__file__).parents[2] / "docs" / "reference" / "protocol.md").read_text()


def _block(beginning: str) -> dict[str, Any]:
    """Return the reference's example that begins with this text."""
    block = REFERENCE[REFERENCE.index("    " + beginning) :].split("\n\n")[0]
    example: dict[str, Any] = json.loads(block)
    return example


def _shape(value: Any) -> Any:
    """Return the type of a value, including its contents: names, and "number" for numbers."""
    if isinstance(value, dict):
        return {name: _shape(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_shape(one) for one in value[:1]]
    return "number" if isinstance(value, int | float) and not isinstance(value, bool) else value


def test_the_state_in_the_reference_is_what_the_wire_carries() -> None:
    example = _block('{"type": "state"')

    async def scenario(world: ServedWorld) -> dict[str, Any]:
        pilot = await world.pilot(sees=True)
        pilot.mode("train")
        pilot.hold("forward")
        await pilot.wait_for_state(driven_by="pilot", within_s=5.0)
        return await pilot.wait_for(
            lambda m: m["type"] == "state" and bool((m["prediction"] or {}).get("action"))
        )

    state = virtually(scenario)
    assert set(state) == set(example)
    for name in ("camera", "prediction"):
        assert set(state[name]) == set(example[name]), name
    for name, value in example.items():
        if state[name] is not None and value is not None:
            assert type(_shape(state[name])) is type(_shape(value)), name


def _table(after: str) -> dict[str, str]:
    """Return the rows of the table that follows this text: first cell to all other cells."""
    text = REFERENCE[REFERENCE.index(after) :]
    lines = text[text.index("|---") :].split("\n\n")[0].splitlines()[1:]
    cells = [line.strip("| ").split(" | ", 1) for line in lines]
    return {first.strip("`"): rest for first, rest in cells}


def test_the_robot_understands_exactly_the_messages_in_the_reference() -> None:
    table = _table("Each message is one JSON object with a `type`. Up:")
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_message('{"type": "no such"}', DEFAULT_MOVES)
    known = str(raised.value).split("known types: ")[1].split(", ")
    assert sorted(table) == sorted(known)
    values = {
        "held": "forward", "frame": 412, "nonce": 7, "seq": 1, "frame_age_ms": 31.0,
        "phone_ms": 4.0, "mode": "train", "client_ms": 2.0, "steering": -0.3, "throttle": 0.5,
        "stop_number": 5,
    }  # fmt: skip
    for kind, row in table.items():
        told = {name for name in values if f"`{name}`" in row.split(" | ")[0]}
        message = protocol.parse_message(
            json.dumps({"type": kind} | {name: values[name] for name in told}),
            DEFAULT_MOVES,
            takes_points=True,
        )
        assert {name for name, value in _fields(message).items() if value is not None} == told, kind


def test_every_message_from_the_robot_matches_its_example_in_the_reference() -> None:
    table = _table("\nDown:\n")

    async def scenario(world: ServedWorld) -> dict[str, dict[str, Any]]:
        pilot = await world.pilot(sees=True)
        other = await world.pilot()
        other.send(type="take")
        pilot.send(type="ping", client_ms=1.0)
        pilot.send(type="mode", mode="train", seq=1_000)
        await other.wait_for(lambda m: m["type"] == "event" and m["name"] == "wheel_waiting")
        await pilot.wait_for(lambda m: m["type"] == "error")
        await pilot.wait_for(lambda m: m["type"] == "pong")
        return {m["type"]: m for m in other.messages + pilot.messages}

    carried = virtually(scenario)
    assert set(carried) == set(table)
    for kind in ("hello", "pong", "error"):
        for name in set(carried[kind]) - {"type"}:
            assert f"`{name}`" in table[kind], f"{kind} carries {name}, and nobody says so"
    for name in ("protocol", "client", "role", "robot", "moves", "declared_moves", "server_ms"):
        assert name in carried["hello"]
    assert carried["hello"]["takes_points"] is False
    move = {name.strip('"') for name in re.findall(r'"[a-z]+"', table["hello"])}
    assert set(carried["hello"]["declared_moves"][0]) == move


POINTS: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "vectors" / "points.json").read_text()
)


@pytest.mark.parametrize("body", POINTS)
def test_a_point_counts_as_the_same_move_as_on_the_page(body: str) -> None:
    moves = [Move(Action(move.pop("name")), **move) for move in POINTS[body]["moves"]]
    for steering, throttle, wanted in POINTS[body]["points"]:
        assert move_at(Point(steering, throttle), moves) == wanted, (steering, throttle)
