"""Serves a robot in virtual time; tests use it like a real one, with httpx, websockets and pilots.

The robot's own threads run on the virtual clock. Time passes only where the test waits.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import random
from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar
from urllib.parse import urlsplit

import anyio.to_thread
import httpx

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.store.folder import Storage
from robot.testing import FakeCamera, FakeDriver, Link, VirtualClock
from robot.types import Action, Example, Mode
from server.access.gateway import NetworkGateway
from server.access.pairing import Pairing
from server.app import create_app
from server.config import Config
from server.persistence import Persistence
from server.services import Services

from .virtual import Pilot, Socket
from .virtual_connections import Body, Exchange, VirtualSocket

WEB = Path(__file__).resolve().parents[2] / "web"
_T = TypeVar("_T")
_PORTS = itertools.count(61_000)
_STEP_S = 0.002
SERVERS: dict[int, VirtualServer] = {}
"""The running servers by port, where httpx and `connect` find them."""


class VirtualServer:
    """A robot, its server and its address; used like `LiveServer`."""

    def __init__(
        self,
        config: Config | None = None,
        pairing: Pairing | None = None,
        data: Path | None = None,
        rig: Rig | None = None,
        persistence: Persistence | None = None,
        name: str = "robot",
        options: Mapping[str, Any] | None = None,
    ) -> None:
        if rig is None:
            clock = VirtualClock(100.0)
            rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), make_policy("published-8"), clock)
        self.clock = rig.clock
        self.rig, self.driver, self.camera = rig, rig.driver, rig.camera
        if data is not None:
            persistence = Persistence(Storage(data), rig, name=name)
        config = config or Config(port=0, web=WEB)
        self.services = Services(
            config,
            rig,
            name="bench",
            persistence=persistence,
            gateway=NetworkGateway(config, rig.clock, pairing),
            options=options,
        )
        self.persistence = persistence
        self.hub = self.services.hub
        self.app = create_app(self.services)
        self.port = next(_PORTS)
        self.address = f"http://127.0.0.1:{self.port}"
        self.dice = random.Random(1)
        self.link = Link(self.dice)
        self.fault = "none"
        """The fault of the board's network on the way to this robot; see
        `classroom_world.FAULTS`."""
        self._sockets: list[Socket] = []
        self._stack = contextlib.ExitStack()

    def ask_loop(self, request: Callable[[], _T]) -> _T:
        """Have the control loop run a function, and wait for the result."""
        return self.clock.result(self.rig.loop.submit(request), 5.0)

    def set_mode(self, mode: Mode) -> None:
        """Choose a mode, like the loop's own thread."""
        assert self.clock.result(self.rig.loop.set_mode(mode), 5.0)

    def use_policy(self, name: str) -> None:
        """Use an untaught policy of this name."""
        self.ask_loop(lambda: self.rig.loop.history.replace_policy(make_policy(name)))

    def teach(
        self,
        lessons: int,
        labels: Sequence[Action] = (Action.LEFT,),
        every_s: float = 0.05,
        policy: str = "",
    ) -> None:
        """Teach this number of examples with different images, and with these labels in turn.

        With `policy`, an untaught policy of this name is taught.
        """
        loop, latest = self.rig.loop, self.camera.latest
        self.wait_until(lambda: latest() is not None)

        def request() -> None:
            if policy:
                loop.history.replace_policy(make_policy(policy))
            frame = latest()
            x = loop.history.policy.extract(frame)
            for i in range(lessons):
                label = labels[i % len(labels)]
                example = Example(frame_id=1000 + i, label=label, is_intervention=False)
                loop.history.teach(example, (x + (i * 37) % 91).astype(x.dtype), i * every_s)

        self.ask_loop(request)

    def ws(self, path: str) -> str:
        return self.address.replace("http", "ws", 1) + path

    def pilot(self) -> VirtualPilot:
        return VirtualPilot(self)

    def __enter__(self) -> Self:
        self._stack.enter_context(threads_of_the_pool_inline())
        self._runner = self._stack.enter_context(self.clock.runner())
        self._stack.enter_context(self.rig)
        self._stack.enter_context(self.persistence or contextlib.nullcontext())
        lifespan = self.app.router.lifespan_context(self.app)
        self.run(lifespan.__aenter__())
        self._stack.callback(lambda: self.run(lifespan.__aexit__(None, None, None)))
        SERVERS[self.port] = self
        return self

    def __exit__(self, *error: object) -> None:
        del SERVERS[self.port]
        for socket in self._sockets:
            socket.cut()
        self.run(self._end_sockets())
        self._stack.close()

    async def _end_sockets(self) -> None:
        await asyncio.gather(*(socket.task for socket in self._sockets), return_exceptions=True)

    # Time --------------------------------------------------------------------------------------

    def run(self, main: Coroutine[Any, Any, _T]) -> _T:
        """Run a coroutine to its end, with everything that is due meanwhile."""
        return self._runner.get_loop().run_until_complete(main)

    def forward(self, seconds: float) -> None:
        """Let time pass."""
        self.run(self.clock.pause(seconds))

    def wait_until(
        self, condition: Callable[[], bool], within_s: float = 5.0, what: str = ""
    ) -> float:
        """Let time pass until a condition holds; return the time passed."""
        start_s = self.clock.now_s()
        self.forward(0)
        while not condition():
            assert self.clock.now_s() - start_s < within_s, f"not within {within_s} s: {what}"
            self.forward(_STEP_S)
        return self.clock.now_s() - start_s

    async def until(
        self, condition: Callable[[], bool], within_s: float = 5.0, what: str = ""
    ) -> float:
        """Let time pass within a coroutine until a condition, which sends no requests, holds."""
        start_s = self.clock.now_s()
        await self.clock.pause(0)
        while not condition():
            assert self.clock.now_s() - start_s < within_s, f"not within {within_s} s: {what}"
            await self.clock.pause(_STEP_S)
        return self.clock.now_s() - start_s

    def poke(self) -> None:
        """Do nothing, because `until` itself checks its condition again."""

    # Requests ----------------------------------------------------------------------------------

    def connect(
        self,
        path: str,
        on_message: Callable[[str | bytes], None],
        headers: dict[str, str] | None = None,
    ) -> Socket:
        """Open a websocket, within the event loop."""
        socket = Socket(
            self, path, on_message, {"host": f"127.0.0.1:{self.port}", **(headers or {})}
        )
        self._sockets.append(socket)
        return socket

    def request(self, request: httpx.Request, path: str | None = None) -> httpx.Response:
        """Answer one request of httpx; `path` replaces the path of the request."""
        exchange = self.run(self._begin(request, path))
        self.run(self.until(lambda: exchange.status is not None or exchange.task.done(), 60.0))
        if exchange.task.done() and exchange.status is None:
            exchange.task.result()
        return httpx.Response(
            exchange.status or 500, headers=exchange.headers, stream=Body(self, exchange)
        )

    def get_raw(self, path: str) -> httpx.Response:
        """Request a path unchanged, which httpx would normalise."""
        request = httpx.Request("GET", self.address)
        return self.request(request, path)

    async def _begin(self, request: httpx.Request, path: str | None) -> Exchange:
        return Exchange(self, request, path)


class VirtualPilot:
    """Runs the pilot `page` in the server's event loop, for tests that are not coroutines."""

    def __init__(
        self, server: VirtualServer, *, sees: bool = False, headers: dict[str, str] | None = None
    ) -> None:
        self._server = server

        async def begin() -> Pilot:
            return Pilot(server, sees=sees, headers=headers)

        self.page = server.run(begin())
        server.wait_until(lambda: bool(self.page.state.get("frame")), what="the first state")

    def __getattr__(self, name: str) -> Any:
        value = getattr(self.page, name)
        if not callable(value):
            return value

        async def act(*args: Any, **fields: Any) -> Any:
            made = value(*args, **fields)
            return await made if name.startswith("wait_for") else made

        return lambda *args, **fields: self._server.run(act(*args, **fields))

    @property
    def is_silent(self) -> bool:
        return self.page.is_silent

    @is_silent.setter
    def is_silent(self, is_silent: bool) -> None:
        self.page.is_silent = is_silent

    def close(self) -> None:
        if not self.page.has_ended:
            self.__getattr__("close")()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


@contextlib.contextmanager
def threads_of_the_pool_inline() -> Iterator[None]:
    """Run routes directly instead of in anyio's thread pool, which would wait in real time."""

    async def run_sync(function: Callable[..., _T], *args: Any, **_: Any) -> _T:
        return function(*args)

    before = anyio.to_thread.run_sync
    anyio.to_thread.run_sync = run_sync
    try:
        yield
    finally:
        anyio.to_thread.run_sync = before


def connect(url: str, **options: Any) -> Any:
    """Open a websocket: to a virtual server if one has this address, or else a real one."""
    parts = urlsplit(url)
    server = SERVERS.get(parts.port or 0)
    if server is None:
        from websockets.sync.client import connect as real_connect

        return real_connect(url, **options)
    return VirtualSocket(server, parts.path, options.get("additional_headers", {}))


_real_handle_request = httpx.HTTPTransport.handle_request


def _handle_request(transport: httpx.HTTPTransport, request: httpx.Request) -> httpx.Response:
    server = SERVERS.get(request.url.port or 0)
    return server.request(request) if server else _real_handle_request(transport, request)


httpx.HTTPTransport.handle_request = _handle_request
