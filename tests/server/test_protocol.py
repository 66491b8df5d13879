from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from robot.types import DEFAULT_MOVES, Encoding
from server import protocol
from server.protocol import ErrorCode, ProtocolError, VideoFrame

from .virtual import ServedWorld, virtually

VECTORS: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "vectors" / "wire.json").read_text()
)


def _named(name: str) -> Any:
    vectors = VECTORS[name]
    return pytest.mark.parametrize(
        "vector", vectors, ids=[v.get("name", str(i)) for i, v in enumerate(vectors)]
    )


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
        encoding=Encoding(fields.pop("encoding")),
        **fields,
    )
    assert protocol.parse_picture(message) == picture
    assert protocol.encode_picture(picture) == message


@_named("acknowledgements")
def test_acknowledgements(vector: dict[str, Any]) -> None:
    message = bytes.fromhex(vector["hex"])
    assert protocol.parse_acknowledgement(message) == vector["frame_id"]
    assert protocol.encode_acknowledgement(vector["frame_id"]) == message


@_named("refused_acknowledgements")
def test_refused_acknowledgements(vector: dict[str, Any]) -> None:
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_acknowledgement(bytes.fromhex(vector["hex"]))
    assert raised.value.code == vector["error"]


@_named("up")
def test_words_up(vector: dict[str, Any]) -> None:
    word = protocol.parse_message(json.dumps(vector), DEFAULT_MOVES)
    wanted = {name: value for name, value in vector.items() if name != "type"}
    assert {name: value for name, value in asdict(word).items() if name in wanted} == wanted
    assert all(value is None for name, value in asdict(word).items() if name not in wanted)


@_named("refused_up")
def test_refused_words_up(vector: dict[str, Any]) -> None:
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_message(vector["text"], DEFAULT_MOVES)
    assert raised.value.code == vector["error"]


def test_a_refusal_names_the_seq_of_the_refused_message() -> None:
    with pytest.raises(ProtocolError) as raised:
        protocol.parse_message('{"type":"drive","held":"up","seq":5}', DEFAULT_MOVES)
    assert json.loads(protocol.encode_error(raised.value))["seq"] == 5


def test_every_kind_of_error_is_in_the_reference() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "protocol.md").read_text()
    assert [code.value for code in ErrorCode if f"`{code.value}`" not in text] == []


def test_the_state_in_the_reference_is_what_the_wire_carries() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "protocol.md").read_text()
    block = text[text.index('    {"type": "state"') :].split("\n\n")[0]
    example = json.loads(block)

    async def scenario(world: ServedWorld) -> dict[str, Any]:
        pilot = await world.pilot(sees=True)
        pilot.mode("train")
        pilot.hold("forward")
        return await pilot.wait_for_state(driven_by="pilot", within_s=5.0)

    state = virtually(scenario)
    assert set(state) == set(example)
    assert set(state["camera"]) == set(example["camera"])
    assert set(state["prediction"]) == set(example["prediction"])
