"""A phone as the robot's eye: its websocket, messages, clock and role, in virtual time."""

import contextlib
import itertools
import json
import struct
from collections.abc import Iterator
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosed

from robot.bodies.phone.camera import PhoneCamera, PhoneOptions
from robot.devices.rig import Rig
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from server.bodies.eye import HEADER, EyeClock, encode_frame, parse_frame, parse_text
from server.bodies.eye_routes import _STATE_FIELDS, EYE
from server.config import Config
from server.gateway.gateway import Gateway
from server.gateway.roles import Refusal, Session
from server.gateway.rules import admit
from server.protocol import ErrorCode, ProtocolError, parse_acknowledgement
from tests.server.live_robot import WEB
from tests.server.virtual_connections import VirtualSocket
from tests.server.virtual_server import VirtualServer, connect

WAIT_S = 20.0
EYE_MS = 5_000_000.0
JPEG = cv2.imencode(".jpg", np.zeros((24, 32, 3), np.uint8))[1].tobytes()


@pytest.fixture
def robot():
    clock = VirtualClock(100.0)
    camera = PhoneCamera(PhoneOptions(eye_rate=12.0), clock)
    rig = Rig(ReplayDriver(clock=clock), camera, make_policy("published-8"), clock)
    with VirtualServer(rig=rig) as server:
        yield server


class Phone:
    """A client without a screen, which answers pings with the time `EYE_MS`."""

    def __init__(self, socket: VirtualSocket) -> None:
        self.socket = socket
        self.words: list[dict[str, Any]] = []
        self.acknowledged: list[int] = []

    def next(self) -> dict[str, Any] | None:
        """Receive one message; answer it if it is a ping."""
        message = self.socket.recv(WAIT_S)
        if isinstance(message, bytes):
            self.acknowledged.append(parse_acknowledgement(message))
            return None
        words: dict[str, Any] = json.loads(message)
        self.words.append(words)
        if words["type"] == "ping":
            answer = {"type": "pong", "server_ms": words["server_ms"], "eye_ms": EYE_MS}
            self.socket.send(json.dumps(answer))
        return words

    def wait_for(self, kind: str) -> dict[str, Any]:
        while True:
            words = self.next()
            if words is not None and words["type"] == kind:
                return words

    def show(self, seq: int, taken_ms: float = EYE_MS) -> None:
        grey = np.full((24, 32, 3), 9 * seq % 256, np.uint8)
        jpeg = cv2.imencode(".jpg", grey)[1].tobytes()
        self.socket.send(encode_frame(seq, taken_ms, jpeg))
        while seq not in self.acknowledged:
            self.next()


@contextlib.contextmanager
def phone(address: str) -> Iterator[Phone]:
    url = address.replace("http", "ws", 1) + "/ws/eye"
    with connect(url, compression=None) as socket:
        yield Phone(socket)


def test_pictures_arrive_with_stamps_on_our_clock(robot):
    rig, address = robot.rig, robot.address
    with phone(address) as eye:
        hello = eye.wait_for("hello")
        assert (hello["width"], hello["height"], hello["rate_hz"]) == (320, 240, 12.0)
        asked = eye.wait_for("ping")
        eye.wait_for("ping")  # by now the robot has read the first answer
        for seq in range(1, 5):
            eye.show(seq)
        frame = rig.camera.latest()
        assert frame is not None and (frame.width, frame.height) == (32, 24)
        assert asked["server_ms"] / 1000 <= frame.captured_s <= rig.clock.now_s()
        assert rig.camera.fault is None
    robot.wait_until(lambda: "disconnected" in (rig.camera.fault or ""))


def test_the_page_may_ask_for_a_camera_and_no_other_may(robot):
    address = robot.address
    page = httpx.get(address + "/eye")
    assert page.status_code == 200 and "eye.js" in page.text
    assert page.headers["permissions-policy"].startswith("camera=(self)")
    assert "camera=()" in httpx.get(address + "/").headers["permissions-policy"]


def test_the_newest_phone_is_the_eye(robot):
    rig, address = robot.rig, robot.address
    with phone(address) as first, phone(address) as second:
        first.wait_for("hello")
        second.wait_for("hello")
        with pytest.raises(ConnectionClosed) as closed:
            for _ in itertools.count():
                first.next()
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4001
        second.wait_for("ping")
        second.wait_for("ping")
        second.show(1)
        assert rig.camera.fault is None


@pytest.mark.parametrize(
    "gone", [WebSocketDisconnect(1006), RuntimeError("once a close message has been sent")]
)
def test_a_phone_that_comes_back_before_its_old_line_has_ended_is_the_eye_again(robot, gone):
    """In an earlier version, the robot refused this phone and every later phone permanently."""
    camera: Any = robot.rig.camera
    with phone(robot.address) as first:
        first.wait_for("hello")

        async def close(*_: object) -> None:
            raise gone

        camera.source._websocket.close = close
        for _ in range(2):
            with phone(robot.address) as again:
                again.wait_for("hello")
                again.wait_for("ping")
                again.wait_for("ping")
                again.show(1)
    robot.wait_until(lambda: camera.source is None)


def test_stop_counts_at_once_while_the_connection_of_the_phone_before_is_closing(robot):
    """Closing a dead connection takes seconds, but the phone reconnects sooner."""
    camera: Any = robot.rig.camera
    with phone(robot.address) as first:
        first.wait_for("hello")

        async def close(*_: object) -> None:
            await robot.clock.pause(2.0)

        camera.source._websocket.close = close
        with phone(robot.address) as again:
            again.socket.send('{"type": "stop"}')
            robot.wait_until(lambda: robot.rig.loop.state.emergency, 0.1, "the robot stands")


def test_a_client_that_sends_nonsense_is_disconnected(robot):
    address = robot.address
    with phone(address) as eye:
        with pytest.raises(ConnectionClosed) as closed:
            for index in range(100_000):
                eye.socket.send(b"rubbish" if index % 2 else "[]")
                if index % 100 == 99:
                    robot.forward(0.1)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1008


def test_a_robot_with_another_camera_says_so():
    with VirtualServer() as server, phone(server.address) as eye:
        with pytest.raises(ConnectionClosed) as closed:
            eye.wait_for("hello")
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4004


@pytest.mark.parametrize("path", ["/eye", "/ws/eye", "/eye/eye.js", "/api/unpair", "/healthz"])
def test_a_phone_paired_as_the_eye_reaches_its_page(path):
    gateway, session = Gateway(Config(), VirtualClock()), Session(EYE, "eye")
    assert admit(gateway, path, "GET", {"accept": "*/*"}, session) is EYE


@pytest.mark.parametrize(
    "path", ["/", "/ws/drive", "/ws/video", "/eyes", "/eye/../api/models", "/video.mjpg"]
)
@pytest.mark.parametrize(("accept", "status"), [("text/html", 303), ("*/*", 403)])
def test_a_phone_paired_as_the_eye_reaches_no_other_page(path, accept, status):
    gateway, session = Gateway(Config(), VirtualClock()), Session(EYE, "eye")
    verdict = admit(gateway, path, "GET", {"accept": accept}, session)
    assert isinstance(verdict, Refusal) and verdict.status == status


# Messages and clock ----------------------------------------------------------------------------

MS = st.floats(0.0, 1e9)


@given(st.integers(0, 2**32 - 1), MS, st.booleans())
def test_a_picture_is_parsed(seq, taken_ms, is_covered):
    frame = parse_frame(encode_frame(seq, taken_ms, JPEG, is_covered=is_covered))
    assert (frame.seq, frame.taken_ms, frame.is_covered) == (seq, taken_ms, is_covered)
    assert (frame.picture.width, frame.picture.height, frame.picture.data) == (32, 24, JPEG)


@given(st.binary(max_size=200))
def test_other_bytes_are_refused(message):
    with pytest.raises(ProtocolError):
        parse_frame(message)
    with pytest.raises(ProtocolError):
        parse_frame(HEADER.pack(3, 0, 0, 1, 1.0) + message)


def test_a_time_that_is_not_a_number_and_a_huge_picture_are_refused():
    with pytest.raises(ProtocolError):
        parse_frame(encode_frame(1, float("nan"), JPEG))
    at = JPEG.index(b"\xff\xc0") + 5
    huge = JPEG[:at] + struct.pack(">HH", 60000, 60000) + JPEG[at + 4 :]
    with pytest.raises(ProtocolError) as refused:
        parse_frame(encode_frame(1, 1.0, huge))
    assert refused.value.code is ErrorCode.TOO_LARGE


@given(st.one_of(st.text(), st.recursive(st.none() | st.floats() | st.text(), st.lists)))
def test_other_messages_are_refused(message):
    for text in (str(message), json.dumps(message), json.dumps({"type": message})):
        if message not in ("stop",):
            with pytest.raises(ProtocolError):
                parse_text(text)


@pytest.mark.parametrize("value", [None, True, "1", [], 1e300, float("inf"), float("nan")])
def test_a_pong_needs_two_numbers(value):
    for name, other in (("server_ms", "eye_ms"), ("eye_ms", "server_ms")):
        with pytest.raises(ProtocolError):
            parse_text(json.dumps({"type": "pong", name: value, other: 1.0}))
    assert parse_text('{"type": "pong", "server_ms": 1, "eye_ms": 2.5}')["eye_ms"] == 2.5


@given(
    st.floats(-1e9, 1e9),
    st.lists(st.tuples(st.floats(0, 400), st.floats(0, 400)), min_size=1, max_size=30),
)
def test_the_error_is_half_the_quickest_round_trip_at_most(offset_ms, ways_ms):
    clock, now_ms = EyeClock(), 1000.0
    clock.note(asked_ms=2 * now_ms, eye_ms=5.0, now_ms=now_ms)
    assert clock.to_ours(1.0) is None, "an answer from the future does not count"
    for down_ms, up_ms in ways_ms:
        clock.note(now_ms, now_ms + down_ms - offset_ms, now_ms + down_ms + up_ms)
        now_ms += 1000.0
    quickest_ms = min(down + up for down, up in ways_ms[-8:])
    mapped_ms = clock.to_ours(now_ms - offset_ms)
    assert mapped_ms is not None
    assert abs(mapped_ms - now_ms) <= quickest_ms / 2 + 1e-3


def test_the_messages_to_the_eye_are_in_the_reference():
    page = (WEB.parent / "docs/howto/phone-eye.md").read_text("utf-8")
    text = page[page.index("## `/ws/eye`") :]
    assert [name for name in _STATE_FIELDS if f"`{name}`" not in text] == []
