"""The page that a browser sees while the robot is still starting.

Importing modules, opening a camera and reading a model take seconds on a small computer. Until the
robot is ready, every request is answered immediately with status 503 and this page. The page
reloads itself, and names the part that is still starting. Because clients are not authenticated
yet, the page contains nothing about the robot, and only the beginning of a request is read.
"""

from __future__ import annotations

import contextlib
import select
import socket
from collections.abc import Sequence
from enum import Enum

from robot.clock import Clock, Worker
from robot.types import StartStop

_PATIENCE_S = 0.2
"""How long a client may take to send its request, in seconds; other clients wait meanwhile."""
_PAGE = """<!doctype html><html><head><meta charset="utf-8"><title>Drivelesson</title>
<meta name="viewport" content="width=device-width"><meta http-equiv="refresh" content="1">
</head><body style="font:1.2em sans-serif;margin:3em;text-align:center">
<p lang="en">Still starting: {0}.</p>
<p lang="es">Todavía se está iniciando: {1}.</p>
<p lang="zh">正在启动：{2}。</p>
</body></html>
"""


class StartingPart(Enum):
    """The name of the part that is still starting, in each of the page's languages."""

    PROGRAM = "the program", "el programa", "程序"
    ROBOT = "the robot and its camera", "el robot y su cámara", "机器人和摄像头"
    MODEL = "the robot's model", "el modelo del robot", "机器人的模型"


class StartingPage(StartStop):
    """Answers requests on listening sockets until `stop`; the server gets all later connections.

    Attributes:
        part: The part that is still starting.
    """

    def __init__(self, listeners: Sequence[socket.socket], clock: Clock) -> None:
        self.part = StartingPart.PROGRAM
        self._listeners, self._clock = list(listeners), clock
        self._wake, self._woken = socket.socketpair()
        self._thread: Worker | None = None

    def start(self) -> None:
        if self._thread is None:
            for listener in self._listeners:
                listener.setblocking(False)
            self._thread = self._clock.start_thread(self._run, "starting page")

    def stop(self) -> None:
        thread, self._thread = self._thread, None
        if thread is not None:
            self._wake.send(b"x")
            thread.join(5.0)
        self._wake.close()
        self._woken.close()

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([*self._listeners, self._woken], [], [])
            if self._woken in ready:
                return
            for listener in ready:
                with contextlib.suppress(OSError):  # the client has left, or sends nothing
                    line, _ = listener.accept()
                    with line:
                        self._answer(line)

    def _answer(self, line: socket.socket) -> None:
        line.settimeout(_PATIENCE_S)
        line.recv(4096)
        body = _PAGE.format(*self.part.value).encode()
        head = (
            "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/html; charset=utf-8\r\n"
            f"Content-Length: {len(body)}\r\nRetry-After: 1\r\nCache-Control: no-store\r\n"
            "X-Drivelesson: starting\r\nConnection: close\r\n\r\n"
        )
        line.sendall(head.encode() + body)
        line.shutdown(socket.SHUT_WR)
