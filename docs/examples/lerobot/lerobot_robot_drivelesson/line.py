"""The two websockets of a served robot: docs/reference/protocol.md."""

from __future__ import annotations

import atexit
import json
import logging
import math
import struct
import threading
import time
import urllib.request
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from websockets.sync.client import ClientConnection, connect

from lerobot_robot_drivelesson.nearest import ACTION, STANDS, nearest

log = logging.getLogger(__name__)
_FRAME = struct.Struct("<BBHHHIId")
_ACKNOWLEDGEMENT = struct.Struct("<BBHI")
_PATIENCE_S = 10.0
_BEAT_S = 0.1
_HOLD_S = 0.5
"""A move that is not asked for again ends after this time, in seconds: LeRobot may be stuck."""
_DONE_WITHIN_S = 0.1
"""How long an order may take until the robot's state shows it, in seconds; it takes some 5 ms."""
_WARN_EVERY_S = 1.0
_REMEMBERED = 100
"""How many of the last orders are remembered, to know which one a refusal is about."""
_WHEEL_S, _START_S, _STARTS = 3.0, 1.0, 5
"""How long the wheel and the start are waited for, in seconds, and how often a start is tried."""
_UNPROVEN = ("stale", "no_picture", "unknown_frame")
"""Refusals of what may be asked for again with the next picture."""
_FRESH_S = 0.2
"""Largest age of the newest nonce for an order, in seconds; the robot refuses one of 0.3 s, which
leaves 0.1 s for the way. Not sending is as safe: a refused order counts as silence, too."""
_WINDOW_S = 30.0
"""Half of the time within which the quickest message is looked for, in seconds."""


def pair(address: str, token: str, kept: Path) -> str:
    """Return the cookie of this computer: the one that is kept, or a new one for a token."""
    if token:
        request = urllib.request.Request(
            f"{address}/api/pair",
            data=json.dumps({"token": token}).encode(),
            headers={"content-type": "application/json"},
        )
        with urllib.request.urlopen(request, timeout=_PATIENCE_S) as answer:
            kept.write_text(answer.headers["set-cookie"].split(";")[0])
        kept.chmod(0o600)
    return kept.read_text() if kept.is_file() else ""


class Sent:
    """Estimates when a message was sent, from the robot's own time in it.

    A program that was held up finds old messages in its sockets: the time at which it reads them
    says nothing. The quickest message of the last minute counts as one that took no time; older
    ones do not count, because two clocks drift apart.
    """

    def __init__(self) -> None:
        self._quickest_s = [math.inf, math.inf]
        self._since_s = 0.0

    def at_s(self, robot_ms: float, now_s: float) -> float:
        """Return when a message that has come now was sent, on our clock, in seconds."""
        sent_s = robot_ms / 1000
        if now_s - self._since_s > _WINDOW_S:
            self._quickest_s, self._since_s = [math.inf, self._quickest_s[0]], now_s
        self._quickest_s[0] = min(self._quickest_s[0], now_s - sent_s)
        return sent_s + min(self._quickest_s)


class Line:
    """A connection: the newest state and picture, and what is held.

    Args:
        address: Of the page, such as http://127.0.0.1:8000.
        cookie: Of a paired computer; empty where the robot needs no pairing.
        drives: Send commands; else only look on.
    """

    def __init__(self, address: str, cookie: str, *, drives: bool) -> None:
        self._base = "ws" + address.rstrip("/").removeprefix("http")
        self._headers = {"Cookie": cookie} if cookie else {}
        self._drives = drives
        self._stack = ExitStack()
        self._news = threading.Condition()
        self._ended = threading.Event()
        self._sending = threading.Lock()
        self._picture: np.ndarray | None = None
        self._frame = self._nonce = None
        self._proven_s = -math.inf
        self._states_sent, self._frames_sent = Sent(), Sent()
        self._seq, self._shown = 0, 0
        self._held: str | None = None
        self._held_s = self._said_s = 0.0
        self._asked: dict[int, str | None] = {}
        self._refused: tuple[int, str, str] = (0, "", "")
        self._n_states, self._warned_s = 0, -math.inf
        self.role, self.robot = "", ""
        self.state: dict[str, Any] = {}
        self.fault = ""
        self._declared: dict[str, tuple[float, float]] = {}
        self.points: dict[str, tuple[float, float]] = {}
        """Steering and throttle of each move that the robot takes now and that has them."""

    def open(self) -> None:
        """Connect, and wait for what the robot says of itself and for a picture."""
        # Once the interpreter ends, closing waits for threads that do not run any more: LeRobot
        # leaves it to `__del__` where something else fails.
        atexit.register(self.close)
        self._drive = self._connect("/ws/drive")
        self._video = self._connect("/ws/video")
        for work in (self._hear, self._watch, *([self._beat] if self._drives else [])):
            thread = threading.Thread(target=self._until_end, args=(work,), daemon=True)
            thread.start()
        self._wait(lambda: self.role and self.state and self._picture is not None, "a picture")

    def begin(self) -> None:
        """Have the wheel, and the robot wait for a pilot's moves.

        Raises:
            ConnectionError: If another has the wheel, or the robot does not start.
        """
        if self.role != "pilot":
            raise ConnectionError(
                f"this computer may only look on at {self.robot}; pair it as a pilot, with "
                "--robot.token"
            )
        if not self._comes(lambda: self.state["you_are_pilot"], 0.3):
            self._send(type="take")
            if not self._comes(lambda: self.state["you_are_pilot"], _WHEEL_S):
                raise ConnectionError(
                    f"the wheel of {self.robot} is in other hands ({self.state['pilot']}, one of "
                    f"{self.state['viewers'] + 1} who are connected): give it away on the page, "
                    "or close the page"
                )
        for _ in range(_STARTS):
            if self.state["emergency"] or not self._may_start():
                break
        if self.state["mode"] != "train":
            raise ConnectionError(f"{self.robot} does not start: {self.why_it_stands}")

    def _may_start(self) -> bool:
        """Ask for the mode once; return whether it is worth asking again."""
        seq, shown = self.choose("train"), self._shown
        is_answered = lambda: self.state["mode"] == "train" or self._refused[0] == seq  # noqa: E731
        self._comes(is_answered, _START_S)
        if self.state["mode"] == "train":
            return False
        if self._refused[0] == seq and self._refused[1] not in _UNPROVEN:
            return False
        self._comes(lambda: self._shown > shown, _START_S)
        return True

    @property
    def why_it_stands(self) -> str:
        """Why the robot does not drive, in a sentence or a word."""
        state = self.state
        if state["emergency"]:
            return "the emergency stop is on; release it on the page"
        if not state["you_are_pilot"]:
            return f"the wheel is in other hands ({state['pilot']})"
        return state["fault"] or self._refused[2] or str(state["stop_reason"])

    def drive(self, asked: Mapping[str, float]) -> tuple[float, float]:
        """Hold the nearest move for half a second at most; return what the robot does then."""
        move = nearest(asked, self.points)
        is_new = move != self._held
        self._held, self._held_s = move, time.monotonic()
        if is_new:
            self._order(move)
        return self.point()

    def _order(self, move: str | None) -> None:
        """Have a move done; again with the next picture where the robot found the proof too old."""
        end_s = time.monotonic() + _DONE_WITHIN_S
        while (left_s := end_s - time.monotonic()) > 0.0:
            if not self._comes(self._is_proven, left_s):
                return  # the next heartbeat says it
            proven_s, states = self._proven_s, self._n_states
            seq = self._beat_once()

            def is_answered(seq: int = seq, states: int = states) -> bool:
                if self._refused[0] == seq:
                    return True
                stands = self.state["mode"] != "train" or not self.state["you_are_pilot"]
                return self.state["action"] == (move or "stop") or (
                    stands and self._n_states > states
                )

            self._comes(is_answered, end_s - time.monotonic())
            if self._refused[0] != seq or self._refused[1] not in _UNPROVEN:
                return
            self._comes(lambda: self._proven_s > proven_s, end_s - time.monotonic())  # noqa: B023

    def warn(self, text: str, *values: object) -> None:
        """Write a warning to the log, once a second at most."""
        now_s = time.monotonic()
        if now_s - self._warned_s >= _WARN_EVERY_S:
            self._warned_s = now_s
            log.warning(text, *values)

    def close(self) -> None:
        """Let go, stop and disconnect."""
        atexit.unregister(self.close)
        self._held = None
        if self._drives and not self._ended.is_set():
            with suppress(Exception):
                self.choose("stopped")
        self._ended.set()
        with suppress(Exception):
            self._stack.close()

    @property
    def is_open(self) -> bool:
        """True until the robot or `close` ends it."""
        return bool(self.role) and not self._ended.is_set()

    def picture(self) -> np.ndarray:
        """Return the next picture, shape (height, width, 3), RGB."""
        shown = self._shown
        self._wait(lambda: self._shown > shown, "a new picture")
        assert self._picture is not None
        return self._picture

    def point(self) -> tuple[float, float]:
        """Return steering and throttle of what the robot does now; zero where it stands."""
        if point := self.state["point"]:
            return point["steering"], point["throttle"]
        return self._declared.get(self.state["action"], STANDS)

    def choose(self, mode: str) -> int:
        """Ask for a mode, and return the number of the message: `train` lets a pilot drive."""
        if mode != "stopped":
            self._comes(self._is_proven, _START_S)
        return self._send(type="mode", mode=mode)

    def _connect(self, path: str) -> ClientConnection:
        return self._stack.enter_context(
            connect(self._base + path, compression=None, additional_headers=self._headers)
        )

    def _until_end(self, work: Any) -> None:
        try:
            work()
        except Exception as error:
            self.fault = self.fault or f"the robot is out of reach: {error}"
        self._ended.set()
        with self._news:
            self._news.notify_all()

    def _hear(self) -> None:
        for text in self._drive:
            said = json.loads(text)
            with self._news:
                if said["type"] == "hello":
                    self._take_hello(said)
                elif said["type"] == "state":
                    self.state = said
                    self._take_nonce(said["nonce"], self._states_sent, said["server_ms"])
                    self._n_states += 1
                elif said["type"] == "error":
                    self._take_error(said)
                self._news.notify_all()

    def _take_hello(self, hello: dict[str, Any]) -> None:
        self.role, self.robot = hello["role"], hello["robot"]
        self._declared = {
            move["name"]: (move["steering"], move["throttle"])
            for move in hello["declared_moves"]
            if None not in (move["steering"], move["throttle"])
        }
        self.points = {
            name: self._declared[name] for name in hello["moves"] if name in self._declared
        }

    def _take_error(self, error: dict[str, Any]) -> None:
        """Note a refusal; a move that is not taken any more is not asked for again."""
        seq = error.get("seq") or 0
        self._refused = seq, error["code"], error["message"]
        move = self._asked.get(seq)
        if error["code"] == "bad_field" and move in self.points:
            self.points = {name: at for name, at in self.points.items() if name != move}
        self.warn("the robot refuses: %s", error["message"])

    def _watch(self) -> None:
        for message in self._video:
            _, encoding, width, height, _, frame, nonce, captured_ms = _FRAME.unpack_from(message)
            data = np.frombuffer(message, np.uint8, offset=_FRAME.size)
            if encoding == 0:
                pixels = cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1]
            elif encoding == 1:
                pixels = cv2.cvtColor(data.reshape(height, width, 2), cv2.COLOR_YUV2RGB_YUY2)
            else:
                pixels = data.reshape(height, width, 3)
            with self._news:
                self._picture, self._frame = pixels, frame
                self._take_nonce(nonce, self._frames_sent, captured_ms)
                self._shown += 1
                self._news.notify_all()
            self._video.send(_ACKNOWLEDGEMENT.pack(2, 0, 0, frame))

    def _take_nonce(self, nonce: int | None, sent: Sent, robot_ms: float) -> None:
        """Keep the newest nonce, and when it was sent."""
        sent_s = sent.at_s(robot_ms, time.monotonic())
        if nonce and sent_s >= self._proven_s:
            self._nonce, self._proven_s = nonce, sent_s

    def _is_proven(self) -> bool:
        """True if the newest nonce still proves that an order is new."""
        return time.monotonic() - self._proven_s <= _FRESH_S

    def _beat(self) -> None:
        while not self._ended.wait(_BEAT_S):
            is_due = time.monotonic() - self._said_s >= 0.9 * _BEAT_S and self._is_proven()
            if is_due and self.state.get("you_are_pilot"):
                self._beat_once()

    def _beat_once(self) -> int:
        """Say what is held; return the number of the message."""
        is_fresh = time.monotonic() - self._held_s < _HOLD_S
        return self._send(type="drive", held=self._held if is_fresh else None)

    def _send(self, **message: Any) -> int:
        with self._sending:
            self._seq += 1
            self._asked[self._seq] = message.get("held")
            self._asked.pop(self._seq - _REMEMBERED, None)
            self._said_s = time.monotonic()
            proof = {"seq": self._seq, "frame": self._frame, "nonce": self._nonce}
            self._drive.send(json.dumps({**message, **proof}))
            return self._seq

    def _comes(self, is_so: Callable[[], Any], seconds: float) -> bool:
        """Wait until something is so; False if it is not in time, ConnectionError at the end."""
        with self._news:
            self._news.wait_for(lambda: is_so() or self._ended.is_set(), seconds)
            if self._ended.is_set():
                raise ConnectionError(self.fault or "the robot has ended the connection")
            return bool(is_so())

    def _wait(self, is_so: Any, what: str) -> None:
        with self._news:
            came = self._news.wait_for(lambda: is_so() or self._ended.is_set(), _PATIENCE_S)
        if not came or self._ended.is_set():
            raise ConnectionError(self.fault or f"the robot gives no sign: no {what}")


class Served:
    """What LeRobot's robot and teleoperator share here: one line, and nothing to calibrate."""

    _line: Line | None = None

    @property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(ACTION, float)

    @property
    def is_connected(self) -> bool:
        return self._line is not None and self._line.is_open

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """Do nothing: the robot's driver knows its wheels."""

    def configure(self) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Let go, stop and disconnect."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _dial(self, *, drives: bool) -> None:
        """Open the line, as the computer that was paired; one that drives has the wheel then."""
        kept = self.calibration_dir / f"{self.id}.cookie"
        cookie = pair(self.config.address, self.config.token, kept)
        self._line = Line(self.config.address, cookie, drives=drives)
        try:
            self._line.open()
            if drives:
                self._line.begin()
        except BaseException:
            self.disconnect()
            raise
