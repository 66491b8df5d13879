"""The phone's socket in virtual time: pictures, STOP, a second phone, and refused roles."""

from __future__ import annotations

import contextlib
import itertools
import json
from collections.abc import Iterator
from typing import Any

import cv2
import httpx
import numpy as np
import pytest
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosed

from robot.bodies.phone.camera import PhoneCamera, PhoneOptions
from robot.devices.rig import Rig
from robot.exchange.replay_driver import ReplayDriver
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from server.bodies.eye import encode_frame
from server.bodies.eye_routes import EYE
from server.config import Config
from server.gateway.gateway import Gateway
from server.gateway.roles import Refusal, Session
from server.gateway.rules import admit
from server.protocol import parse_acknowledgement
from tests.server.virtual_connections import VirtualSocket
from tests.server.virtual_server import VirtualServer, connect

WAIT_S = 20.0
EYE_MS = 5_000_000.0


@pytest.fixture
def robot() -> Iterator[VirtualServer]:
    clock = VirtualClock(100.0)
    camera = PhoneCamera(PhoneOptions(eye_rate=12.0), clock)
    rig = Rig(ReplayDriver(clock=clock), camera, make_policy("published-8"), clock)
    with VirtualServer(rig=rig) as server:
        yield server


class Phone:
    """A phone without a screen that answers questions about its clock, by `EYE_MS`."""

    def __init__(self, socket: VirtualSocket) -> None:
        self.socket = socket
        self.words: list[dict[str, Any]] = []
        self.acknowledged: list[int] = []

    def next(self) -> dict[str, Any] | None:
        """Receive one message; answer a question about the clock."""
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


def test_pictures_arrive_with_stamps_on_our_clock(robot: VirtualServer) -> None:
    rig, address = robot.rig, robot.address
    with phone(address) as eye:
        hello = eye.wait_for("hello")
        assert (hello["width"], hello["height"], hello["rate_hz"]) == (320, 240, 12.0)
        asked = eye.wait_for("ping")
        eye.wait_for("ping")  # the first answer has been taken by now
        for seq in range(1, 5):
            eye.show(seq)
        frame = rig.camera.latest()
        assert frame is not None and (frame.width, frame.height) == (32, 24)
        assert asked["server_ms"] / 1000 <= frame.captured_s <= rig.clock.now_s()
        assert rig.camera.fault is None
    robot.wait_until(lambda: "gone" in (rig.camera.fault or ""))


def test_the_page_may_ask_for_a_camera_and_no_other_may(robot: VirtualServer) -> None:
    address = robot.address
    page = httpx.get(address + "/eye")
    assert page.status_code == 200 and "eye.js" in page.text
    assert page.headers["permissions-policy"].startswith("camera=(self)")
    assert "camera=()" in httpx.get(address + "/").headers["permissions-policy"]


def test_the_newest_phone_is_the_eye(robot: VirtualServer) -> None:
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
def test_a_phone_that_comes_back_before_its_old_line_has_ended_is_the_eye_again(
    robot: VirtualServer, gone: Exception
) -> None:
    """Before, such a phone was refused permanently, and so was every later phone."""
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


def test_stop_counts_at_once_while_the_connection_of_the_phone_before_is_closing(
    robot: VirtualServer,
) -> None:
    """It takes seconds to close a dead connection, but the phone is back sooner."""
    camera: Any = robot.rig.camera
    with phone(robot.address) as first:
        first.wait_for("hello")

        async def close(*_: object) -> None:
            await robot.clock.pause(2.0)

        camera.source._websocket.close = close
        with phone(robot.address) as again:
            again.socket.send('{"type": "stop"}')
            robot.wait_until(lambda: robot.rig.loop.state.emergency, 0.1, "it stands")


def test_a_client_that_sends_nonsense_is_disconnected(robot: VirtualServer) -> None:
    address = robot.address
    with phone(address) as eye:
        with pytest.raises(ConnectionClosed) as closed:
            for index in range(100_000):
                eye.socket.send(b"rubbish" if index % 2 else "[]")
                if index % 100 == 99:
                    robot.forward(0.1)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1008


def test_a_robot_with_another_camera_says_so() -> None:
    with VirtualServer() as server, phone(server.address) as eye:
        with pytest.raises(ConnectionClosed) as closed:
            eye.wait_for("hello")
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4004


@pytest.mark.parametrize(
    ("path", "may"),
    [
        ("/eye", True),
        ("/ws/eye", True),
        ("/eye/eye.js", True),
        ("/eye/eye.css", True),
        ("/api/unpair", True),
        ("/healthz", True),
        ("/", False),
        ("/ws/drive", False),
        ("/ws/video", False),
        ("/api/models", False),
        ("/eyes", False),
        ("/eye/../api/models", False),
        ("/video.mjpg", False),
    ],
)
def test_a_phone_paired_as_the_eye_reaches_only_that_page(path: str, may: bool) -> None:
    gateway, session = Gateway(Config(), VirtualClock()), Session(EYE, "eye")
    for accept in ("text/html", "*/*"):
        headers = {"accept": accept}
        verdict = admit(gateway, path, "GET", headers, session)
        assert (verdict is EYE) == may
        if not may:
            assert isinstance(verdict, Refusal)
            assert verdict.status == (303 if accept == "text/html" else 403)
