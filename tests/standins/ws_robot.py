"""A robot that serves a websocket, as in docs/reference/robot-protocol.md."""

from __future__ import annotations

import hashlib
import hmac
import json
import threading
import time
from typing import Any, Self

import websockets

from tests.kit.loops import LoopThread


class WsRobot:
    """A robot that moves until the time of its move is over; while `silent`, it answers nobody.

    `repeats` is the number of additional copies of the next answer, like late answers.
    """

    def __init__(self, secret: str = "") -> None:
        self.secret, self.nonce = secret.encode(), "aabbccdd"
        self.seq, self.ends_s = 0, 0.0
        self.silent = threading.Event()
        self.repeats = 0
        self.connections = 0
        self._sockets: set[Any] = set()
        self.port = 0

    @property
    def is_moving(self) -> bool:
        return time.monotonic() < self.ends_s

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def __enter__(self) -> Self:
        self._loop = LoopThread()
        self.port = self._loop.serve(lambda: websockets.serve(self._talk, "127.0.0.1", 0))
        return self

    def __exit__(self, *error: object) -> None:
        self._loop.close()

    def start_again(self) -> None:
        """Restart, as if switched off and on: all connections end, and all state is lost."""

        async def drop() -> None:
            self.nonce, self.seq, self.ends_s = "ddccbbaa", 0, 0.0
            for socket in list(self._sockets):
                socket.transport.abort()

        self._loop.do(drop())

    async def _talk(self, socket: Any, path: str = "") -> None:
        self.connections += 1
        self._sockets.add(socket)
        try:
            await self._answer_all(socket)
        except websockets.ConnectionClosed:
            pass
        finally:
            self._sockets.discard(socket)

    async def _answer_all(self, socket: Any) -> None:
        is_deaf = False
        async for message in socket:
            is_deaf = is_deaf or self.silent.is_set()
            # the connection stays closed: a client that wants an answer must connect again
            if is_deaf:
                continue
            self._obey(message.encode())
            ms = int(time.monotonic() * 1000)
            report = {"nonce": self.nonce, "seq": self.seq, "ms": ms, "distance_m": 0.5}
            repeats, self.repeats = self.repeats, 0
            for _ in range(1 + repeats):
                await socket.send(json.dumps({**report, "bumped": False, "battery": 0.9}))

    def _obey(self, message: bytes) -> None:
        text, _, mac = message.partition(b"\t")
        wanted = hmac.new(self.secret, self.nonce.encode() + text, hashlib.sha256).hexdigest()[:16]
        order = json.loads(text)
        if mac.decode() == wanted and order["seq"] > self.seq:
            self.seq = order["seq"]
            is_move = order["move"] != "stop"
            self.ends_s = time.monotonic() + order["for_ms"] / 1000 if is_move else 0.0
