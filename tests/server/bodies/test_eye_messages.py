"""The eye's messages and clock: every message is read or refused, and time stamps stay correct."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.bodies.eye import HEADER, EyeClock, encode_frame, parse_frame, parse_text
from server.bodies.eye_routes import _STATE_FIELDS
from server.protocol import ErrorCode, ProtocolError

JPEG = cv2.imencode(".jpg", np.zeros((24, 32, 3), np.uint8))[1].tobytes()
MS = st.floats(0.0, 1e9)


@given(st.integers(0, 2**32 - 1), MS, st.booleans())
def test_a_picture_comes_through(seq: int, taken_ms: float, is_covered: bool) -> None:
    frame = parse_frame(encode_frame(seq, taken_ms, JPEG, is_covered=is_covered))
    assert (frame.seq, frame.taken_ms, frame.is_covered) == (seq, taken_ms, is_covered)
    assert (frame.picture.width, frame.picture.height, frame.picture.data) == (32, 24, JPEG)


@given(st.binary(max_size=200))
def test_other_bytes_are_refused(message: bytes) -> None:
    with pytest.raises(ProtocolError):
        parse_frame(message)
    with pytest.raises(ProtocolError):
        parse_frame(HEADER.pack(3, 0, 0, 1, 1.0) + message)


def test_a_time_that_is_not_a_number_and_a_huge_picture_are_refused() -> None:
    with pytest.raises(ProtocolError):
        parse_frame(encode_frame(1, float("nan"), JPEG))
    at = JPEG.index(b"\xff\xc0") + 5
    huge = JPEG[:at] + struct.pack(">HH", 60000, 60000) + JPEG[at + 4 :]
    with pytest.raises(ProtocolError) as refused:
        parse_frame(encode_frame(1, 1.0, huge))
    assert refused.value.code is ErrorCode.TOO_LARGE


@given(st.one_of(st.text(), st.recursive(st.none() | st.floats() | st.text(), st.lists)))
def test_other_messages_are_refused(message: object) -> None:
    for text in (str(message), json.dumps(message), json.dumps({"type": message})):
        if message not in ("stop",):
            with pytest.raises(ProtocolError):
                parse_text(text)


@pytest.mark.parametrize("value", [None, True, "1", [], 1e300, float("inf"), float("nan")])
def test_a_pong_needs_two_numbers(value: object) -> None:
    for name, other in (("server_ms", "eye_ms"), ("eye_ms", "server_ms")):
        with pytest.raises(ProtocolError):
            parse_text(json.dumps({"type": "pong", name: value, other: 1.0}))
    assert parse_text('{"type": "pong", "server_ms": 1, "eye_ms": 2.5}')["eye_ms"] == 2.5


@given(
    st.floats(-1e9, 1e9),
    st.lists(st.tuples(st.floats(0, 400), st.floats(0, 400)), min_size=1, max_size=30),
)
def test_the_error_is_half_the_quickest_round_trip_at_most(
    offset_ms: float, ways_ms: list[tuple[float, float]]
) -> None:
    clock, now_ms = EyeClock(), 1000.0
    for down_ms, up_ms in ways_ms:
        clock.note(now_ms, now_ms + down_ms - offset_ms, now_ms + down_ms + up_ms)
        now_ms += 1000.0
    quickest_ms = min(down + up for down, up in ways_ms[-8:])
    mapped_ms = clock.to_ours(now_ms - offset_ms)
    assert mapped_ms is not None
    assert abs(mapped_ms - now_ms) <= quickest_ms / 2 + 1e-3


def test_before_the_first_answer_nothing_is_known_and_answers_from_the_future_do_not_count() -> (
    None
):
    clock = EyeClock()
    assert clock.to_ours(1.0) is None
    clock.note(asked_ms=2000.0, eye_ms=5.0, now_ms=1000.0)
    assert clock.to_ours(1.0) is None


def test_the_messages_to_the_eye_are_in_the_reference() -> None:
    page = (Path(__file__).parents[3] / "docs/howto/phone-eye.md").read_text("utf-8")
    text = page[page.index("## `/ws/eye`") :]
    assert [name for name in _STATE_FIELDS if f"`{name}`" not in text] == []
