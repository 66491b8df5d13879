"""A served robot in virtual time behind the ways of the real one: httpx, websockets, a pilot.

The robot's own threads run on the virtual clock. Time passes only where the test waits.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import random
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any, Self, TypeVar
from urllib.parse import unquote, urlsplit

import anyio.to_thread
import httpx
from websockets.exceptions import ConnectionClosedError, ConnectionClosedOK, InvalidStatus
from websockets.frames import Close

from robot.policy.registry import make_policy
from robot.rig.rig import Rig
from robot.storage.folder import Storage
from robot.testing import FakeCamera, FakeDriver, Link, VirtualClock
from robot.types import Mode
from server.app import create_app
from server.config import Config
from server.persistence import Persistence
from server.security.pairing import Pairing
from server.services import make_services

from .virtual import Pilot, Socket

WEB = Path(__file__).resolve().parents[2] / "web"
_T = TypeVar("_T")
_PORTS = itertools.count(61_000)
_STEP_S = 0.002
SERVERS: dict[int, VirtualServer] = {}
"""The servers that run now, by their port; httpx and `connect` find them here."""


class VirtualServer:
    """A robot, its server and its address; used as `LiveServer` is."""

    def __init__(
        self,
        config: Config | None = None,
        pairing: Pairing | None = None,
        data: Path | None = None,
        rig: Rig | None = None,
        persistence: Persistence | None = None,
        name: str = "robot",
    ) -> None:
        if rig is None:
            clock = VirtualClock(100.0)
            rig = Rig(FakeDriver(clock=clock), FakeCamera(clock), make_policy("published-8"), clock)
        assert isinstance(rig.clock, VirtualClock)
        self.clock = rig.clock
        self.rig = rig
        if data is not None:
            persistence = Persistence(Storage(data), rig, name=name)
        self.services = make_services(
            config or Config(port=0, web=WEB),
            rig,
            name="bench",
            persistence=persistence,
            pairing=pairing,
        )
        self.hub = self.services.hub
        self.app = create_app(self.services)
        self.port = next(_PORTS)
        self.address = f"http://127.0.0.1:{self.port}"
        self.dice = random.Random(1)
        self.link = Link(self.dice)
        self._sockets: list[Socket] = []
        self._stack = contextlib.ExitStack()

    @property
    def persistence(self) -> Persistence:
        assert self.services.persistence is not None
        return self.services.persistence

    def ask_loop(self, request: Callable[[], _T]) -> _T:
        """Have the control loop run something, and wait for what comes of it."""
        return self.clock.result(self.rig.loop.submit(request), 5.0)

    def set_mode(self, mode: Mode) -> None:
        """Choose a mode as the loop's own thread would."""
        assert self.clock.result(self.rig.loop.set_mode(mode), 5.0)

    @property
    def driver(self) -> FakeDriver:
        assert isinstance(self.rig.driver, FakeDriver)
        return self.rig.driver

    @property
    def camera(self) -> FakeCamera:
        assert isinstance(self.rig.camera, FakeCamera)
        return self.rig.camera

    def ws(self, path: str) -> str:
        return self.address.replace("http", "ws", 1) + path

    def pilot(self) -> VirtualPilot:
        return VirtualPilot(self)

    def __enter__(self) -> Self:
        self._stack.enter_context(threads_of_the_pool_inline())
        self._runner = self._stack.enter_context(self.clock.runner())
        self._stack.enter_context(self.rig)
        if self.services.persistence is not None:
            self._stack.enter_context(self.services.persistence)
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
        """Run a coroutine to its end, and whatever happens meanwhile."""
        return self._runner.run(main)

    def forward(self, seconds: float) -> None:
        """Let time pass."""
        self.run(self.clock.pause(seconds))

    def wait_until(
        self, condition: Callable[[], bool], within_s: float = 5.0, what: str = ""
    ) -> float:
        """Let time pass until a condition holds; return how long it took."""
        start_s = self.clock.now_s()
        self.forward(0)
        while not condition():
            assert self.clock.now_s() - start_s < within_s, f"not within {within_s} s: {what}"
            self.forward(_STEP_S)
        return self.clock.now_s() - start_s

    async def until(
        self, condition: Callable[[], bool], within_s: float = 5.0, what: str = ""
    ) -> float:
        """Do the same within a coroutine, where a condition can make no requests."""
        start_s = self.clock.now_s()
        await self.clock.pause(0)
        while not condition():
            assert self.clock.now_s() - start_s < within_s, f"not within {within_s} s: {what}"
            await self.clock.pause(_STEP_S)
        return self.clock.now_s() - start_s

    def poke(self) -> None:
        """Nothing waits for it here: `until` looks again by itself."""

    # Requests ----------------------------------------------------------------------------------

    def connect(
        self,
        path: str,
        on_message: Callable[[str | bytes], None],
        headers: dict[str, str] | None = None,
    ) -> Socket:
        """Open a websocket; within the event loop."""
        socket = Socket(
            self, path, on_message, {"host": f"127.0.0.1:{self.port}", **(headers or {})}
        )
        self._sockets.append(socket)
        return socket

    def request(self, request: httpx.Request, path: str | None = None) -> httpx.Response:
        """Answer one request of httpx; `path` goes before its own."""
        exchange = self.run(self._begin(request, path))
        self.wait_until(lambda: exchange.status is not None or exchange.task.done(), 60.0)
        if exchange.task.done() and exchange.status is None:
            exchange.task.result()
        return httpx.Response(
            exchange.status or 500, headers=exchange.headers, stream=_Body(self, exchange)
        )

    def get_raw(self, path: str) -> httpx.Response:
        """Ask for a path as it stands, which httpx would tidy up."""
        request = httpx.Request("GET", self.address)
        return self.request(request, path)

    async def _begin(self, request: httpx.Request, path: str | None) -> Exchange:
        return Exchange(self, request, path)


class Exchange:
    """One HTTP request and what has been answered so far."""

    def __init__(self, server: VirtualServer, request: httpx.Request, raw_path: str | None) -> None:
        self.status: int | None = None
        self.headers: list[tuple[bytes, bytes]] = []
        self.chunks: list[bytes] = []
        self.is_over = False
        self._incoming: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        assert isinstance(request.stream, httpx.SyncByteStream)
        chunks = list(request.stream)
        for number, chunk in enumerate(chunks or [b""]):
            more = number < len(chunks) - 1
            self._incoming.put_nowait({"type": "http.request", "body": chunk, "more_body": more})
        whole = request.url.raw_path if raw_path is None else raw_path.encode()
        path, _, query = whole.partition(b"?")
        scope = {
            "type": "http",
            "asgi": {"version": "3.0", "spec_version": "2.3"},
            "http_version": "1.1",
            "method": request.method,
            "scheme": request.url.scheme,
            "path": unquote(path.decode("ascii")),
            "raw_path": path,
            "query_string": query,
            "root_path": "",
            "headers": [(name.lower(), value) for name, value in request.headers.raw],
            "client": ("127.0.0.1", 50_000),
            "server": ("127.0.0.1", server.port),
            "extensions": {},
        }
        self.task = asyncio.ensure_future(server.app(scope, self._incoming.get, self._send))

    async def _send(self, message: dict[str, Any]) -> None:
        if message["type"] == "http.response.start":
            self.status, self.headers = message["status"], list(message.get("headers", []))
        else:
            self.chunks.append(message.get("body", b""))
            self.is_over = not message.get("more_body", False)

    def hang_up(self) -> None:
        self._incoming.put_nowait({"type": "http.disconnect"})


class _Body(httpx.SyncByteStream):
    def __init__(self, server: VirtualServer, exchange: Exchange) -> None:
        self._server, self._exchange = server, exchange

    def __iter__(self) -> Iterator[bytes]:
        exchange = self._exchange
        while True:
            while exchange.chunks:
                yield exchange.chunks.pop(0)
            if exchange.is_over or exchange.task.done():
                return
            self._server.wait_until(
                lambda: bool(exchange.chunks) or exchange.is_over or exchange.task.done(), 60.0
            )

    def close(self) -> None:
        self._exchange.hang_up()
        if not self._exchange.is_over:
            with contextlib.suppress(Exception):
                self._server.run(asyncio.wait_for(self._exchange.task, 1.0))
        else:
            self._server.wait_until(self._exchange.task.done, 60.0)


class VirtualSocket:
    """A websocket as the library `websockets` has it, to a virtual server."""

    def __init__(self, server: VirtualServer, path: str, headers: dict[str, str]) -> None:
        self._server = server
        self._messages: list[str | bytes] = []

        async def begin() -> Socket:
            return server.connect(path, self._messages.append, headers)

        self._socket = server.run(begin())
        server.wait_until(lambda: self._socket.is_accepted or self._socket.is_closed)
        if self._socket.refused_with is not None:
            raise InvalidStatus(_Refused(self._socket.refused_with))  # type: ignore[arg-type]

    @property
    def close_code(self) -> int | None:
        return self._socket.close_code

    def send(self, message: str | bytes) -> None:
        self._check_open()
        self._socket.send(message)
        self._server.forward(0)

    def recv(self, timeout: float | None = 60.0) -> str | bytes:
        try:
            self._server.wait_until(
                lambda: bool(self._messages) or self._socket.is_closed, timeout or 60.0
            )
        except AssertionError as error:
            raise TimeoutError(str(error)) from error
        if self._messages:
            return self._messages.pop(0)
        self._check_open()
        raise AssertionError("unreachable")

    def close(self) -> None:
        if not self._socket.is_closed:
            self._socket.close()
            self._server.wait_until(self._socket.task.done)

    def _check_open(self) -> None:
        code = self._socket.close_code
        if self._socket.is_closed:
            kind = ConnectionClosedOK if code in (1000, 1001) else ConnectionClosedError
            raise kind(Close(code or 1006, ""), None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class _Refused:
    def __init__(self, status_code: int) -> None:
        self.status_code = status_code


class VirtualPilot:
    """The pilot of `virtual.py`, for a test that is no coroutine."""

    def __init__(
        self, server: VirtualServer, *, sees: bool = False, headers: dict[str, str] | None = None
    ) -> None:
        self._server = server

        async def begin() -> Pilot:
            return Pilot(server, sees=sees, headers=headers)

        self.page = server.run(begin())
        server.wait_until(lambda: bool(self.page.state.get("frame")), what="the first state")

    def __getattr__(self, name: str) -> Any:
        return getattr(self.page, name)

    @property
    def is_silent(self) -> bool:
        return self.page.is_silent

    @is_silent.setter
    def is_silent(self, is_silent: bool) -> None:
        self.page.is_silent = is_silent

    def hold(self, held: str | None) -> None:
        self._do(self.page.hold, held)

    def mode(self, mode: str) -> None:
        self._do(self.page.mode, mode)

    def send(self, **message: Any) -> None:
        self._do(self.page.send, **message)

    def close(self) -> None:
        if not self.page.has_ended:
            self._do(self.page.close)

    def vanish(self) -> None:
        self._do(self.page.vanish)

    def _do(self, action: Callable[..., None], *args: Any, **fields: Any) -> None:
        async def act() -> None:
            action(*args, **fields)

        self._server.run(act())

    def wait_for(
        self, wanted: Callable[[dict[str, Any]], bool], within_s: float = 5.0
    ) -> dict[str, Any]:
        return self._server.run(self.page.wait_for(wanted, within_s))

    def wait_for_state(self, within_s: float = 5.0, **fields: Any) -> dict[str, Any]:
        return self._server.run(self.page.wait_for_state(within_s, **fields))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


@contextlib.contextmanager
def threads_of_the_pool_inline() -> Iterator[None]:
    """Have routes that go to a thread of anyio's pool run where they are: it waits for real."""

    async def run_sync(function: Callable[..., _T], *args: Any, **_: Any) -> _T:
        return function(*args)

    before = anyio.to_thread.run_sync
    anyio.to_thread.run_sync = run_sync  # type: ignore[assignment]
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


httpx.HTTPTransport.handle_request = _handle_request  # type: ignore[method-assign]
