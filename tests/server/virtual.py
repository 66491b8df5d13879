"""Serves a robot to pilots in virtual time, with the real app, hub, protocol, loop and gate.

Only uvicorn and the sockets are missing. See CONTRIBUTING.md, "Tests in virtual time".
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import inspect
import json
from collections.abc import Callable, Coroutine
from typing import Any, Self, TypeVar
from urllib.parse import unquote

from fastapi import FastAPI

from robot.testing import Line, Link, VirtualClock, VirtualRobot
from robot.types import Action, Mode, Point
from server.app import create_app
from server.config import Config
from server.protocol import encode_acknowledgement, parse_picture
from server.services import Services

from .live_robot import WEB

_T = TypeVar("_T")
BEAT_S = 0.1


def virtually(
    scenario: Callable[[ServedWorld], Coroutine[Any, Any, _T]],
    config: Config | None = None,
    **options: Any,
) -> _T:
    """Run a scenario on a served robot in virtual time; `options` are those of `VirtualRobot`."""
    clock = VirtualClock(100.0)

    async def main() -> _T:
        async with ServedWorld(clock, config, **options) as world:
            return await scenario(world)

    return clock.run(main())


def in_virtual_time(
    config: Config | None = None, **options: Any
) -> Callable[[Callable[..., Coroutine[Any, Any, None]]], Callable[..., None]]:
    """Run a test that is a coroutine in virtual time; its first argument is a served robot.

    The arguments are those of `virtually`; a parameter `seed` of the test is also the robot's seed.
    """

    def run(scenario: Callable[[ServedWorld], Coroutine[Any, Any, None]], **named: Any) -> None:
        virtually(scenario, config, **options, **named)

    return lambda test: with_first_argument(run, test)


def with_first_argument(
    run: Callable[..., None], test: Callable[..., Coroutine[Any, Any, None]]
) -> Callable[..., None]:
    """Return a test for pytest; `run` gives the coroutine its first argument, and the seed."""

    @functools.wraps(test)
    def wrapped(**fixtures: Any) -> None:
        seed = {name: value for name, value in fixtures.items() if name == "seed"}
        run(lambda world: test(world, **fixtures), **seed)

    signature = inspect.signature(test)
    wanted = list(signature.parameters.values())[1:]
    wrapped.__signature__ = signature.replace(parameters=wanted)
    return wrapped


class ServedWorld(VirtualRobot):
    """A `VirtualRobot` with a server around it, and links to it."""

    def __init__(self, clock: VirtualClock, config: Config | None = None, **options: Any) -> None:
        super().__init__(clock, **options)
        self.services = Services(config or Config(web=WEB), self.rig, name="virtual")
        self.hub = self.services.hub
        self.link = Link(self.dice)
        self._stack = contextlib.AsyncExitStack()
        self._sockets: list[Socket] = []

    async def __aenter__(self) -> Self:
        await super().__aenter__()
        await self.hub.start()
        self._stack.push_async_callback(self.hub.stop)
        for extension in self.services.extensions.values():
            self._stack.enter_context(extension)
        return self

    @functools.cached_property
    def app(self) -> FastAPI:
        """The application, which is made at first use, because some tests never need it."""
        return create_app(self.services)

    async def __aexit__(self, *error: object) -> None:
        for socket in self._sockets:
            socket.cut()
        await asyncio.gather(*(socket.task for socket in self._sockets), return_exceptions=True)
        await self._stack.aclose()
        await super().__aexit__(*error)

    async def pilot(self, *, sees: bool = False) -> Pilot:
        """Open a page, and wait for its first state."""
        pilot = Pilot(self, sees=sees)
        await self.until(lambda: bool(pilot.state.get("frame")), what="the first state")
        return pilot

    def connect(self, path: str, on_message: Callable[[str | bytes], None]) -> Socket:
        """Open a websocket through the link."""
        socket = Socket(self, path, on_message)
        self._sockets.append(socket)
        return socket

    def stands(self) -> bool:
        """True while the wheels do not turn."""
        return self.driver.now is Action.STOP

    @property
    def mode(self) -> Mode:
        """The mode that the loop shows."""
        return self.loop.state.decision.mode


def asgi_scope(
    kind: str, scheme: str, path: str, headers: list[tuple[bytes, bytes]], **more: Any
) -> dict[str, Any]:
    """Return the scope of a request or websocket from this computer."""
    path, _, query = path.partition("?")
    return {
        "type": kind,
        "asgi": {"version": "3.0", "spec_version": "2.3"},
        "http_version": "1.1",
        "scheme": scheme,
        "path": unquote(path),
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "root_path": "",
        "headers": headers,
        "client": ("127.0.0.1", 50_000),
        "server": ("127.0.0.1", 8000),
        "state": {},
        "extensions": {},
        **more,
    }


class Socket:
    """One websocket: the app's ASGI messages, and the link between app and page."""

    def __init__(
        self,
        world: Any,
        path: str,
        on_message: Callable[[str | bytes], None],
        headers: dict[str, str] | None = None,
    ) -> None:
        self._world = world
        self._on_message = on_message
        self._incoming: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._incoming.put_nowait({"type": "websocket.connect"})
        self._up: Line = world.link.line(self._incoming.put_nowait, throttled=False)
        self._down: Line = world.link.line(self._arrive, throttled=True)
        self.close_code: int | None = None
        self.is_accepted = False
        self.refused_with: int | None = None
        named = headers or {"host": "127.0.0.1:8000"}
        encoded = [(name.encode(), value.encode()) for name, value in named.items()]
        more = {"subprotocols": [], "extensions": {"websocket.http.response": {}}}
        scope = asgi_scope("websocket", "ws", path, encoded, **more)
        self.task = asyncio.ensure_future(world.app(scope, self._incoming.get, self._send))

    def send(self, message: str | bytes) -> None:
        """Send one message to the server."""
        kind = "text" if isinstance(message, str) else "bytes"
        self._up.send({"type": "websocket.receive", kind: message}, len(message))

    def close(self) -> None:
        """Close the connection; the server notices when the link has delivered it."""
        self._up.send({"type": "websocket.disconnect", "code": 1001}, 8)

    def cut(self) -> None:
        """End like a killed browser: nothing more arrives, and the server sees a reset."""
        self._world.link.forget(self._up)
        self._world.link.forget(self._down)
        self._incoming.put_nowait({"type": "websocket.disconnect", "code": 1006})

    @property
    def is_closed(self) -> bool:
        """True once no more messages can arrive."""
        return self.close_code is not None or self.task.done()

    async def _send(self, message: dict[str, Any]) -> None:
        data = message.get("text") or message.get("bytes") or ""
        self._down.send(message, len(data))
        await self._down.has_room()

    def _arrive(self, message: dict[str, Any]) -> None:
        if message["type"] == "websocket.send":
            text = message.get("text")
            self._on_message(text if text is not None else message["bytes"])
        elif message["type"] == "websocket.accept":
            self.is_accepted = True
        elif message["type"] == "websocket.http.response.start":
            self.refused_with = message["status"]
        elif message["type"] == "websocket.close":
            if not self.is_accepted:
                self.refused_with = 403
            self.close_code = message.get("code", 1000)
            self._incoming.put_nowait({"type": "websocket.disconnect", "code": self.close_code})
        self._world.poke()


class Pilot:
    """A client without a screen: holds a move, and sends a heartbeat every 100 ms until it ends."""

    def __init__(self, world: Any, *, sees: bool, headers: dict[str, str] | None = None) -> None:
        self._world = world
        self.messages: list[dict[str, Any]] = []
        self.state: dict[str, Any] = {}
        self.held: str | None = None
        self.point: Point | None = None
        self.seq = 0
        self.picture: int | None = None
        self.nonce: int | None = None
        self.is_silent = False
        self.acknowledges = True
        self.has_ended = False
        more = {"headers": headers} if headers else {}
        self.socket = world.connect("/ws/drive", self._hear, **more)
        self._video = world.connect("/ws/video", self._see, **more) if sees else None
        self._event_loop = asyncio.get_running_loop()
        self._event_loop.call_later(BEAT_S * world.dice.random(), self._beat)

    @property
    def hello(self) -> dict[str, Any]:
        """The server's first message."""
        return self.messages[0]

    def hold(self, held: str | None, point: Point | None = None) -> None:
        """Press or release a move, perhaps with a point, and send it at once."""
        self.held, self.point = held, point
        self._say_drive()

    def mode(self, mode: str) -> None:
        """Request a mode."""
        self.seq += 1
        self.send(type="mode", mode=mode, seq=self.seq, **self.sight())

    def release(self) -> None:
        """Release the STOP that the newest state shows."""
        self.send(type="release", stop_number=self.state["stop_number"])

    def sight(self) -> dict[str, int | None]:
        """Return the proof that a command needs: the shown picture and the newest nonce."""
        return {"frame": self.picture or self.state.get("frame"), "nonce": self.nonce}

    def send(self, **message: Any) -> None:
        """Send one message of any kind."""
        self._up(self.socket, json.dumps(message))

    def errors(self) -> list[str]:
        """Return the codes of all refusals."""
        return [m["code"] for m in self.messages if m["type"] == "error"]

    def close(self) -> None:
        """Close the tab."""
        self.has_ended = True
        for socket in self._open_sockets():
            socket.close()

    def close_pictures(self) -> None:
        """Close only the pictures' connection; messages continue."""
        self._video.close()

    def vanish(self) -> None:
        """Disconnect like a killed browser, without a closing handshake."""
        self.has_ended = True
        for socket in self._open_sockets():
            socket.cut()

    async def wait_for(
        self, wanted: Callable[[dict[str, Any]], bool], within_s: float = 5.0
    ) -> dict[str, Any]:
        """Return the first wanted message of all that arrived."""
        found: list[dict[str, Any]] = []

        def is_there() -> bool:
            found[:] = [message for message in self.messages if wanted(message)][:1]
            return bool(found)

        await self._world.until(is_there, within_s, f"last messages: {self.messages[-3:]}")
        return found[0]

    async def wait_for_state(self, within_s: float = 5.0, **fields: Any) -> dict[str, Any]:
        """Return the newest state as soon as it has these fields."""
        await self._world.until(
            lambda: bool(self.state) and fields.items() <= self.state.items(),
            within_s,
            f"state {fields}",
        )
        return self.state

    def _up(self, socket: Socket, message: str | bytes) -> None:
        socket.send(message)

    def _open_sockets(self) -> list[Socket]:
        return [socket for socket in (self.socket, self._video) if socket is not None]

    def _hear(self, text: str | bytes) -> None:
        message = json.loads(text)
        self.messages.append(message)
        if message["type"] == "state":
            self.state = message
            self.nonce = message["nonce"]

    def _see(self, message: str | bytes) -> None:
        picture = parse_picture(message)
        self.picture, self.nonce = picture.frame_id, picture.nonce
        if self._video is not None and self.acknowledges and not self.has_ended:
            self._up(self._video, encode_acknowledgement(self.picture))

    def _beat(self) -> None:
        if self.has_ended:
            return
        if not self.is_silent:
            self._say_drive()
        self._event_loop.call_later(BEAT_S, self._beat)

    def _say_drive(self) -> None:
        self.seq += 1
        point = self.point._asdict() if self.point else {}
        self.send(type="drive", held=self.held, seq=self.seq, **point, **self.sight())
