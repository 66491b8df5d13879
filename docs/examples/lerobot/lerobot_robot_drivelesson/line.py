"""A client of the two websockets of a served robot (docs/reference/protocol.md)."""

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
"""A move that LeRobot does not renew ends after this time, in seconds: LeRobot may hang."""
_DONE_WITHIN_S = 0.1
"""Timeout until the robot's state shows a new order, in seconds; usually it takes about 5 ms."""
_WARN_EVERY_S = 1.0
_REMEMBERED = 100
"""The number of recent orders that are stored, to find the order that a refusal belongs to."""
_WHEEL_S, _START_S, _STARTS = 3.0, 1.0, 5
"""Timeouts for getting the wheel and for a start, in seconds, and the number of start attempts."""
_UNPROVEN = ("stale", "no_picture", "unknown_frame")
"""Error codes after which an order is retried with the next picture."""
_FRESH_S = 0.2
"""The maximum age of an order's nonce, in seconds. The robot refuses nonces older than 0.3 s; the
difference of 0.1 s is for the network. An order that is not sent is as safe as a refused one."""
_WINDOW_S = 30.0
"""Half of the period over which the fastest message is determined, in seconds."""


def pair(address: str, token: str, kept: Path) -> str:
    """Return this computer's cookie: a new one if there is a token, else the saved one."""
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
    """Estimates when a message was sent, from the robot's time in the message.

    The time of reading is useless: a program that was delayed reads old messages. The estimate
    assumes that the fastest message of the last minute took no time. Older messages are ignored,
    because the two clocks drift apart.
    """

    def __init__(self) -> None:
        self._quickest_s = [math.inf, math.inf]
        self._since_s = 0.0

    def at_s(self, robot_ms: float, now_s: float) -> float:
        """Return when the message received at `now_s` was sent, on our clock, in seconds."""
        sent_s = robot_ms / 1000
        if now_s - self._since_s > _WINDOW_S:
            self._quickest_s, self._since_s = [math.inf, self._quickest_s[0]], now_s
        self._quickest_s[0] = min(self._quickest_s[0], now_s - sent_s)
        return sent_s + min(self._quickest_s)


class Line:
    """A connection to a robot, with the newest state and picture, and the move that is held.

    Args:
        address: The address of the robot's page, such as http://127.0.0.1:8000.
        cookie: The cookie of this paired computer; empty if the robot needs no pairing.
        drives: If true, send commands; otherwise only watch.
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
        """Steering and throttle by move, for the moves that the robot accepts now."""

    def open(self) -> None:
        """Connect, and wait for the robot's hello message, its state and a picture."""
        # If LeRobot fails, it closes the robot only in `__del__`, while the interpreter exits.
        # That would wait for threads that no longer run, so we close the robot before.
        atexit.register(self.close)
        self._drive = self._connect("/ws/drive")
        self._video = self._connect("/ws/video")
        for work in (self._hear, self._watch, *([self._beat] if self._drives else [])):
            thread = threading.Thread(target=self._until_end, args=(work,), daemon=True)
            thread.start()
        self._wait(lambda: self.role and self.state and self._picture is not None, "a picture")

    def begin(self) -> None:
        """Take the wheel, and start the robot in the mode `train`.

        Raises:
            ConnectionError: If another client has the wheel, or the robot does not start.
        """
        if self.role != "pilot":
            raise ConnectionError(
                f"this computer is paired with {self.robot} only as a viewer; pair it as a pilot, "
                "with --robot.token"
            )
        if not self._comes(lambda: self.state["you_are_pilot"], 0.3):
            self._send(type="take")
            if not self._comes(lambda: self.state["you_are_pilot"], _WHEEL_S):
                raise ConnectionError(
                    f"another client has the wheel of {self.robot} ({self.state['pilot']}, one of "
                    f"{self.state['viewers'] + 1} connected clients): hand it over on that page, "
                    "or close that page"
                )
        for _ in range(_STARTS):
            if self.state["emergency"] or not self._may_start():
                break
        if self.state["mode"] != "train":
            raise ConnectionError(f"{self.robot} does not start: {self.why_it_stands}")

    def _may_start(self) -> bool:
        """Request the mode `train` once; return whether a retry makes sense."""
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
        """The reason why the robot stands still, as a sentence or a word."""
        state = self.state
        if state["emergency"]:
            return "the emergency stop is on; release it on the page"
        if not state["you_are_pilot"]:
            return f"another client has the wheel ({state['pilot']})"
        return state["fault"] or self._refused[2] or str(state["stop_reason"])

    def drive(self, asked: Mapping[str, float]) -> tuple[float, float]:
        """Hold the nearest move for at most half a second; return what the robot then does."""
        move = nearest(asked, self.points)
        is_new = move != self._held
        self._held, self._held_s = move, time.monotonic()
        if is_new:
            self._order(move)
        return self.point()

    def _order(self, move: str | None) -> None:
        """Order a move; retry with the next picture if the robot finds the nonce too old."""
        end_s = time.monotonic() + _DONE_WITHIN_S
        while (left_s := end_s - time.monotonic()) > 0.0:
            if not self._comes(self._is_proven, left_s):
                return  # the next heartbeat sends the order
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
        """Log a warning, at most once a second."""
        now_s = time.monotonic()
        if now_s - self._warned_s >= _WARN_EVERY_S:
            self._warned_s = now_s
            log.warning(text, *values)

    def close(self) -> None:
        """Release the move, stop the robot and disconnect."""
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
        """True until the robot or `close` ends the connection."""
        return bool(self.role) and not self._ended.is_set()

    def picture(self) -> np.ndarray:
        """Return the next picture, shape (height, width, 3), RGB."""
        shown = self._shown
        self._wait(lambda: self._shown > shown, "a new picture")
        assert self._picture is not None
        return self._picture

    def point(self) -> tuple[float, float]:
        """Return the robot's current steering and throttle; both are zero if it stands still."""
        if point := self.state["point"]:
            return point["steering"], point["throttle"]
        return self._declared.get(self.state["action"], STANDS)

    def choose(self, mode: str) -> int:
        """Request a mode, and return the message's number. In `train`, the pilot can drive."""
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
            self.fault = self.fault or f"the connection to the robot failed: {error}"
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
        """Record a refusal; a move that the robot no longer accepts is not requested again."""
        seq = error.get("seq") or 0
        self._refused = seq, error["code"], error["message"]
        move = self._asked.get(seq)
        if error["code"] == "bad_field" and move in self.points:
            self.points = {name: at for name, at in self.points.items() if name != move}
        self.warn("the robot refuses a command: %s", error["message"])

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
        """Store the newest nonce, and the time at which it was sent."""
        sent_s = sent.at_s(robot_ms, time.monotonic())
        if nonce and sent_s >= self._proven_s:
            self._nonce, self._proven_s = nonce, sent_s

    def _is_proven(self) -> bool:
        """Return whether the newest nonce is young enough for an order."""
        return time.monotonic() - self._proven_s <= _FRESH_S

    def _beat(self) -> None:
        while not self._ended.wait(_BEAT_S):
            is_due = time.monotonic() - self._said_s >= 0.9 * _BEAT_S and self._is_proven()
            if is_due and self.state.get("you_are_pilot"):
                self._beat_once()

    def _beat_once(self) -> int:
        """Send the move that is held; return the message's number."""
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
        """Wait for a condition; False on timeout, ConnectionError if the connection ends."""
        with self._news:
            self._news.wait_for(lambda: is_so() or self._ended.is_set(), seconds)
            if self._ended.is_set():
                raise ConnectionError(self.fault or "the robot closed the connection")
            return bool(is_so())

    def _wait(self, is_so: Any, what: str) -> None:
        with self._news:
            came = self._news.wait_for(lambda: is_so() or self._ended.is_set(), _PATIENCE_S)
        if not came or self._ended.is_set():
            raise ConnectionError(self.fault or f"the robot did not send {what}")


class Served:
    """Base of our LeRobot robot and teleoperator: one connection, and no calibration."""

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
        """Do nothing: the robot's driver needs no calibration."""

    def configure(self) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Release the move, stop the robot and disconnect."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _dial(self, *, drives: bool) -> None:
        """Connect as this paired computer, and take the wheel if `drives` is true."""
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
