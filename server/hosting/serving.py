"""Configures uvicorn (any version) for low latency, without compression or delays."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import gc
import logging
import signal
import socket
from collections.abc import Coroutine, Sequence
from typing import TYPE_CHECKING, Any

from robot.entry_points import points
from robot.errors import ConfigurationError, InUseError
from server.gateway.gateway import Gateway

if TYPE_CHECKING:
    from uvicorn import Server


PROTOCOLS = "drivelesson.websockets"
"""Group of entry points: functions that return a websocket protocol class, or None."""
DIRECT = "drivelesson.direct"
"""Key in `scope["extensions"]`: the websocket's protocol, if it can write pictures directly."""
MAX_MESSAGE_BYTES = 65_536
"""Maximum size of a websocket message in bytes; a larger one closes the connection unread."""
_DEAD_PEER_MS = 15_000
_BACKLOG = 4096
"""Length of the accept queue. When it is full, a client retries only after a second."""
_END_S = 1.0
"""Shutdown timeout in seconds: first for requests to finish, then for connections to close."""


def open_socket(host: str, port: int) -> socket.socket:
    """Listen on an address, with socket options for low latency."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        # With SO_REUSEADDR on Windows, two programs would share the port.
        exclusive = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
        listener.setsockopt(socket.SOL_SOCKET, exclusive, 1)
        # On Linux, connections inherit these options. The first sends small messages immediately,
        # the second closes a connection whose peer acknowledges nothing.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _DEAD_PEER_MS)
        if family == socket.AF_INET6 and hasattr(socket, "IPV6_V6ONLY"):
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.bind((host, port))
        listener.listen(_BACKLOG)
    except (OSError, TypeError) as error:  # a TypeError: the text cannot be a host name
        listener.close()
        why = getattr(error, "strerror", None) or "there is no such host"
        is_taken = getattr(error, "errno", None) in (errno.EADDRINUSE, errno.EADDRNOTAVAIL)
        raise (InUseError if is_taken else ConfigurationError)(
            f"cannot serve on {host} port {port}: {why}; choose another with --host or --port"
        ) from error
    return listener


def open_sockets(host: str, port: int) -> list[socket.socket]:
    """Listen on an address; for `::` (all addresses), on two sockets with the same port. The socket
    for IPv4 reports clients' IPv4 addresses in their usual form. On a machine that lacks IPv4 or
    IPv6, only the other socket is opened."""
    if host != "::":
        return [open_socket(host, port)]
    found: list[socket.socket] = []
    for one in ("0.0.0.0", "::"):
        try:
            found.append(open_socket(one, found[0].getsockname()[1] if found else port))
        except ConfigurationError as error:
            is_taken = getattr(error.__cause__, "errno", None) == errno.EADDRINUSE
            if is_taken or (one == "::" and not found):
                for listener in found:
                    listener.close()
                raise
    return found


def websocket_protocol() -> Any:
    """Return the websocket protocol for uvicorn: that of an extension, or "websockets"."""
    return next(filter(None, (point.load()() for point in points(PROTOCOLS))), "websockets")


def make_server(app: Any, tls_files: tuple[str, str] | None) -> Server:
    """Return a uvicorn server that uses the newest websocket backend of its version."""
    import uvicorn

    config = uvicorn.Config(
        app,
        ssl_keyfile=tls_files[0] if tls_files else None,
        ssl_certfile=tls_files[1] if tls_files else None,
        ws=websocket_protocol(),
        ws_per_message_deflate=False,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_ping_interval=10.0,
        ws_ping_timeout=20.0,
        http="h11",
        access_log=False,
        # Let uvicorn ignore X-Forwarded-For, with which a client could claim any address.
        proxy_headers=False,
        log_config=None,
        log_level="warning",
        server_header=False,
        timeout_keep_alive=15,
        backlog=_BACKLOG,
        lifespan="on",
    )
    return uvicorn.Server(config)


def leave_out_of_collections() -> None:
    """Exclude all existing objects from garbage collection. A full garbage collection would block
    every thread for 100 to 300 ms, including the control loop and a STOP."""
    gc.collect()
    gc.freeze()


def serve(app: Any, listeners: Sequence[socket.socket]) -> None:
    """Serve until SIGINT or SIGTERM, behind the gateway `app.state.gateway`."""
    gateway: Gateway = app.state.gateway
    server = make_server(app, gateway.tls_files)
    server.config.load()
    if server.config.ssl is not None:
        gateway.use_tls(server.config.ssl)
    leave_out_of_collections()
    with contextlib.ExitStack() as stack:
        limited = [stack.enter_context(gateway.limit(one)) for one in listeners]
        run(serve_until_told(server, gateway, *limited))


def end_by_signals() -> None:
    """Let SIGTERM and a closed terminal end the program like Ctrl-C. After its shutdown, uvicorn
    raises the signal again; the default handler would not stop the motors or save the model."""

    def end(*_: object) -> None:  # not SystemExit, which would count as a plugin's error
        raise KeyboardInterrupt(0)

    signal.signal(signal.SIGTERM, end)
    for name in {"SIGHUP", "SIGBREAK"} & set(dir(signal)):
        if signal.getsignal(number := getattr(signal, name)) is signal.SIG_DFL:  # nohup ignores it
            signal.signal(number, lambda *_: signal.raise_signal(signal.SIGTERM))


def run(served: Coroutine[Any, Any, None]) -> None:
    """Run on an event loop that calls our listener's `accept`; Windows' default loop does not."""
    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        runner.run(served)


async def serve_until_told(server: Server, gateway: Gateway, *listeners: socket.socket) -> None:
    """Serve until a signal ends the server. Then close connections that hang, for example in an
    upload, and cancel requests that wait for a thread."""
    logging.getLogger("uvicorn.error").addFilter(_is_not_cancellation)
    serving = asyncio.ensure_future(server.serve(sockets=list(listeners)))
    # Newer versions of uvicorn raise the signal again. Read the error, or asyncio would log it.
    serving.add_done_callback(lambda done: done.cancelled() or done.exception())
    while not server.should_exit and not serving.done():
        gateway.expire()
        await asyncio.wait([serving], timeout=0.1)
    await asyncio.wait([serving], timeout=_END_S)
    if not serving.done():
        gateway.close_connections()
        await asyncio.wait([serving], timeout=_END_S)
        for task in list(server.server_state.tasks):
            task.cancel()
        await asyncio.wait([serving], timeout=_END_S)
        server.force_exit = True
    await serving


def _is_not_cancellation(record: logging.LogRecord) -> bool:
    kind = record.exc_info[0] if record.exc_info else None  # starlette logs a traceback as text
    return kind is not asyncio.CancelledError and not str(record.msg).endswith("CancelledError\n")
