"""The two websockets of a served robot: docs/reference/protocol.md."""

from __future__ import annotations

import json
import struct
import threading
import time
import urllib.request
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from websockets.sync.client import ClientConnection, connect

ACTION = ("steering.pos", "throttle.vel")
"""What is done, and asked for: lerobot-rollout passes on such endings alone."""
_FRAME = struct.Struct("<BBHHHIId")
_ACKNOWLEDGEMENT = struct.Struct("<BBHI")
_PATIENCE_S = 10.0
_BEAT_S = 0.1
_HOLD_S = 0.5
"""A move that is not asked for again ends after so long: LeRobot may be stuck."""


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
        self._seq, self._shown = 0, 0
        self._held, self._held_s = None, 0.0
        self.state: dict[str, Any] = {}
        self.fault = ""
        self.points: dict[str, tuple[float, float]] = {}
        """Steering and throttle of each move for which the body declares them."""

    def open(self) -> None:
        """Connect, and wait for what the robot says of itself and for a picture."""
        self._drive = self._connect("/ws/drive")
        self._video = self._connect("/ws/video")
        for work in (self._hear, self._watch, *([self._beat] if self._drives else [])):
            thread = threading.Thread(target=self._until_end, args=(work,), daemon=True)
            thread.start()
        self._wait(lambda: self.points and self.state and self._picture is not None, "a picture")

    def close(self) -> None:
        """Let go, stop and disconnect."""
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
        return bool(self.points) and not self._ended.is_set()

    def picture(self) -> np.ndarray:
        """Return the next picture, shape (height, width, 3), RGB."""
        shown = self._shown
        self._wait(lambda: self._shown > shown, "a new picture")
        assert self._picture is not None
        return self._picture

    def hold(self, move: str | None) -> None:
        """Have the robot make a move, for half a second at most."""
        self._held, self._held_s = move, time.monotonic()

    def point(self) -> tuple[float, float]:
        """Return steering and throttle of what the robot does now; zero where it stands."""
        return self.points.get(self.state["action"], (0.0, 0.0))

    def choose(self, mode: str) -> None:
        """Ask for a mode: `train` lets a pilot drive."""
        self._send(type="mode", mode=mode)

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
                    self.points = {
                        move["name"]: (move["steering"], move["throttle"])
                        for move in said["declared_moves"]
                        if None not in (move["steering"], move["throttle"])
                    }
                elif said["type"] == "state":
                    self.state, self._nonce = said, said["nonce"] or self._nonce
                self._news.notify_all()

    def _watch(self) -> None:
        for message in self._video:
            _, encoding, width, height, _, frame, nonce, _ = _FRAME.unpack_from(message)
            data = np.frombuffer(message, np.uint8, offset=_FRAME.size)
            if encoding == 0:
                pixels = cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1]
            elif encoding == 1:
                pixels = cv2.cvtColor(data.reshape(height, width, 2), cv2.COLOR_YUV2RGB_YUY2)
            else:
                pixels = data.reshape(height, width, 3)
            with self._news:
                self._picture, self._frame, self._nonce = pixels, frame, nonce or self._nonce
                self._shown += 1
                self._news.notify_all()
            self._video.send(_ACKNOWLEDGEMENT.pack(2, 0, 0, frame))

    def _beat(self) -> None:
        while not self._ended.wait(_BEAT_S):
            is_fresh = time.monotonic() - self._held_s < _HOLD_S
            self._send(type="drive", held=self._held if is_fresh else None)

    def _send(self, **message: Any) -> None:
        with self._sending:
            self._seq += 1
            proof = {"seq": self._seq, "frame": self._frame, "nonce": self._nonce}
            self._drive.send(json.dumps({**message, **proof}))

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
        """Open the line, as the computer that was paired."""
        kept = self.calibration_dir / f"{self.id}.cookie"
        cookie = pair(self.config.address, self.config.token, kept)
        self._line = Line(self.config.address, cookie, drives=drives)
        self._line.open()
