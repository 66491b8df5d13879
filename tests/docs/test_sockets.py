"""docs/reference/asyncapi.json describes the messages that the server sends and accepts."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import jsonschema
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.control.state import LinkLevel
from robot.moves import CLASSIC
from robot.types import DrivenBy, Mode, Point, StopReason
from server.protocol import (
    ACKNOWLEDGEMENT,
    FRAME_HEADER,
    MAX_COUNT,
    PROTOCOL_VERSION,
    BareMessage,
    DriveMessage,
    ErrorCode,
    ModeMessage,
    Ping,
    ProtocolError,
    ReleaseMessage,
    _numbers_of,
    parse_message,
)
from tests.kit.sizes import examples
from tests.server.virtual_server import VirtualServer

PAGE = Path(__file__).parents[2] / "docs/reference/asyncapi.json"
DESCRIBED = json.loads(PAGE.read_text("utf-8"))
SCHEMAS = DESCRIBED["components"]["schemas"]
UP, DOWN = (
    {name.removeprefix(way): schema for name, schema in SCHEMAS.items() if name.startswith(way)}
    for way in ("up.", "down.")
)
MOVES = tuple(CLASSIC)


def test_every_reference_leads_somewhere_and_every_message_is_on_a_socket() -> None:
    for reference in set(re.findall(r'"\$ref": "#/([^"]+)"', PAGE.read_text("utf-8"))):
        found: Any = DESCRIBED
        for part in reference.split("/"):
            found = found[part]
    messages = DESCRIBED["components"]["messages"]
    placed = [name for one in DESCRIBED["channels"].values() for name in one["messages"]]
    assert sorted(placed) == sorted(messages) and {*SCHEMAS} < {*messages}
    for schema in SCHEMAS.values():
        jsonschema.Draft7Validator.check_schema(schema)


def test_names_limits_and_sizes_equal_those_of_the_code() -> None:
    state = DOWN["state"]["properties"]
    for name, words in {
        "mode": Mode,
        "driven_by": DrivenBy,
        "link": LinkLevel,
        "stop_reason": [*StopReason, None],
    }.items():
        assert state[name]["enum"] == [*words], name
    assert DOWN["error"]["properties"]["code"]["enum"] == [*ErrorCode]
    assert UP["mode"]["properties"]["mode"]["enum"] == [*Mode]
    assert {*UP} == {"drive", "mode", "ping", "release", *BareMessage}
    assert DOWN["hello"]["properties"]["protocol"] == {"const": PROTOCOL_VERSION}
    for kind, sent in {
        "drive": DriveMessage,
        "mode": ModeMessage,
        "ping": Ping,
        "release": ReleaseMessage,
    }.items():
        for field, _, _, least, most, _ in _numbers_of(sent):
            described = UP[kind]["properties"][field]
            assert (described["minimum"], described["maximum"]) == (least, most), (kind, field)
    for name, header in {"down.frame": FRAME_HEADER, "up.acknowledgement": ACKNOWLEDGEMENT}.items():
        summary = DESCRIBED["components"]["messages"][name]["summary"]
        assert summary.startswith(f"{header.size} bytes"), name


def without_more(schema: Any) -> Any:
    """Return the description with unnamed fields forbidden, at every depth."""
    if isinstance(schema, list):
        return [without_more(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    inner = {name: without_more(one) for name, one in schema.items()}
    return {"additionalProperties": False, **inner} if "properties" in schema else inner


def test_the_server_sends_exactly_the_described_messages() -> None:
    with VirtualServer() as server, server.pilot() as pilot:
        pilot.mode("train")
        pilot.hold("forward")
        server.forward(1.0)
        pilot.send(type="ping", client_ms=1.5)
        pilot.send(type="dance")
        pilot.send(type="mode", mode="fly", seq=10**6)
        server.forward(0.5)
        pilot.send(type="stop")
        server.forward(0.5)
        messages = list(pilot.page.messages)
    kinds = {message["type"] for message in messages}
    assert {"hello", "state", "pong", "error"} <= kinds
    for message in messages:
        schema = DOWN[message["type"]]
        is_whole = message["type"] in ("hello", "state")
        jsonschema.validate(message, without_more(schema) if is_whole else schema)
    assert {"malformed", *(m["code"] for m in messages if m["type"] == "error")} <= {*ErrorCode}


NUMBERS = st.one_of(
    st.integers(-2, 3),
    st.sampled_from([MAX_COUNT, MAX_COUNT + 1, 2**32 - 1, 2**32, -MAX_COUNT - 1]),
    st.floats(-9, 9).filter(lambda number: not number.is_integer()),
    st.sampled_from([-1.0, -0.3, 0.3, 1.0]),
)
VALUES = st.one_of(NUMBERS, st.none(), st.booleans(), st.just("forward"), st.just([]))
FIELDS = (
    *("held", "seq", "frame", "nonce", "frame_age_ms", "phone_ms", "client_ms", "mode"),
    *Point._fields,
)


@settings(max_examples=examples(500), deadline=None)
@given(
    kind=st.sampled_from(["drive", "mode", "ping", *BareMessage]),
    fields=st.dictionaries(st.sampled_from(FIELDS), VALUES | st.sampled_from([*Mode, *MOVES])),
)
def test_the_server_accepts_exactly_the_described_messages(
    kind: str, fields: dict[str, Any]
) -> None:
    message = {"type": str(kind), **fields}
    if isinstance(fields.get("held"), str) and fields["held"] not in MOVES:
        return  # `hello` lists the moves
    try:
        parse_message(json.dumps(message), MOVES, takes_points=True)
        is_taken = True
    except ProtocolError:
        is_taken = False
    is_described = jsonschema.Draft7Validator(UP[str(kind)]).is_valid(message)
    assert is_taken == is_described, message
    assert all(math.isfinite(v) for v in fields.values() if isinstance(v, float))


def test_every_message_and_field_of_the_description_is_in_the_reference() -> None:
    reference = PAGE.with_name("protocol.md").read_text("utf-8")
    for kind, schema in (UP | DOWN).items():
        assert f"| `{kind}` |" in reference
        names = schema.get("properties", {}).keys() - {"type"}
        missing = [name for name in names if not re.search(rf"[`\"]{name}[`\"]", reference)]
        assert missing == [], kind
