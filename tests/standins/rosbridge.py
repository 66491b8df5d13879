"""A small rosbridge with a ROS robot, whose base never stops by itself."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import itertools
import json
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any, Self

import websockets

from robot.types import Point
from tests.kit.frames import grey_jpeg
from tests.kit.loops import LoopThread
from tests.kit.wait import wait_until

IMAGES = "/camera/image_raw/compressed"
SETTLED = "/settled"


class RosBridgeServer:
    """While `frozen`, the rosbridge receives and sends nothing, not even pongs. `cmd_vel` lists all
    velocities so far, and `told` lists all messages by topic."""

    def __init__(self) -> None:
        self.frozen = threading.Event()
        self.topics: dict[str, str] = {}
        self.cmd_vel: list[dict[str, Any]] = []
        self.told: dict[str, list[dict[str, Any]]] = defaultdict(list)
        self.answers: Callable[[dict[str, Any]], list[str]] = lambda asked: []
        """Returns further messages that answer an operation."""
        self.port = 0
        self._sockets: set[Any] = set()
        self._listeners: dict[str, set[Any]] = defaultdict(set)
        self._over = threading.Event()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def is_moving(self) -> bool:
        return any(self.drives)

    @property
    def drives(self) -> Point:
        """The motion of the robot's base: its turn rate to the right, and its speed ahead."""
        if not self.cmd_vel:
            return Point(0.0, 0.0)
        twist = self.cmd_vel[-1].get("twist", self.cmd_vel[-1])
        return Point(-twist["angular"]["z"], twist["linear"]["x"])

    def settle(self, bridge: Any) -> None:
        """Wait until all messages of the client have arrived; for None, until no client is left."""
        if self.frozen.is_set():
            return
        if bridge is None:
            wait_until(lambda: not self._sockets, "no client")
            return
        marks = self.told[SETTLED]
        count = len(marks) + 1
        bridge.publish(SETTLED, {})
        wait_until(lambda: len(marks) >= count, "all messages have arrived")

    def __enter__(self) -> Self:
        self._loop = LoopThread()
        self.port = self._loop.serve(
            lambda: websockets.serve(
                self._talk, "127.0.0.1", self.port, ping_interval=None, close_timeout=0.1
            )
        )
        for work in (self._show(), self._freeze()):
            asyncio.run_coroutine_threadsafe(work, self._loop.event_loop)
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self._loop.close()

    async def _freeze(self) -> None:
        while not self._over.is_set():
            await asyncio.sleep(0.005)
            while self.frozen.is_set() and not self._over.is_set():
                time.sleep(0.005)  # pauses the whole process, like SIGSTOP

    async def _talk(self, socket: Any, path: str = "") -> None:
        self._sockets.add(socket)
        try:
            async for data in socket:
                asked = json.loads(data)
                # A client that has left gets no answer, but its messages are still obeyed.
                with contextlib.suppress(websockets.ConnectionClosed):
                    for text in self.answers(asked):
                        await socket.send(text)
                with contextlib.suppress(websockets.ConnectionClosed):
                    await self._obey(socket, asked)
        except websockets.ConnectionClosed:
            pass
        finally:
            self._sockets.discard(socket)
            for listeners in self._listeners.values():
                listeners.discard(socket)

    async def _obey(self, socket: Any, asked: dict[str, Any]) -> None:
        topic = asked.get("topic", "")
        if asked["op"] == "advertise":
            self.topics[topic] = asked["type"]
        elif asked["op"] == "subscribe":
            self._listeners[topic].add(socket)
        elif asked["op"] == "unsubscribe":
            self._listeners[topic].discard(socket)
        elif asked["op"] == "publish":
            assert topic in self.topics or topic == SETTLED, "no node has advertised this topic"
            await self._pass_on(topic, asked["msg"])

    async def _pass_on(self, topic: str, message: dict[str, Any]) -> None:
        self._note(topic, message)
        await self._tell_listeners(topic, message)

    async def _tell_listeners(self, topic: str, message: dict[str, Any]) -> None:
        """Send to all clients; one that is just leaving causes no error for the others."""
        text = json.dumps({"op": "publish", "topic": topic, "msg": message})
        for listener in list(self._listeners[topic]):
            with contextlib.suppress(websockets.ConnectionClosed):
                await listener.send(text)

    def _note(self, topic: str, message: dict[str, Any]) -> None:
        self.told[topic].append(message)
        if "twist" in self.topics.get(topic, "").lower():
            self.cmd_vel.append(message)

    async def _show(self) -> None:
        for index in itertools.count():
            await asyncio.sleep(0.03)
            if self._listeners[IMAGES]:
                await self._pass_on(IMAGES, grey_image(index))
                self.told[IMAGES].clear()


def grey_image(index: int) -> dict[str, Any]:
    """Return a sensor_msgs/CompressedImage as rosbridge writes it: bytes in base64."""
    header = {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "camera"}
    return {
        "header": header,
        "format": "jpeg",
        "data": base64.b64encode(grey_jpeg(index)).decode(),
    }
