"""Functions that all websockets share, to receive messages without delay and to end cleanly."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect

from robot.clock import Clock
from server.clients.client import RefusalCounter
from server.gateway.guard import note_use
from server.hosting.serving import DIRECT

_LAST_S = 1.0
"""How long a client's messages are still read after it was told to disconnect, in seconds."""
_GONE = ("ClientDisconnected", "ConnectionClosed", "ConnectionClosedOK", "ConnectionClosedError")


def fast_path(websocket: WebSocket) -> Any:
    """Return the interface that bypasses ASGI's queues; None if the websocket has none."""
    return websocket.scope.get("extensions", {}).get(DIRECT)


async def converse(
    websocket: WebSocket,
    clock: Clock,
    *,
    hear: Callable[[str | bytes], None],
    sending: Coroutine[Any, Any, None],
    refusals: RefusalCounter,
    idle_s: float | None = None,
    see: Callable[[bytes], Coroutine[Any, Any, None]] | None = None,
) -> None:
    """Serve a client until it disconnects, is silent for `idle_s`, or has too many refusals.

    `hear` gets each message as soon as it is decoded, even while the socket closes. So a STOP
    counts even if its client is being disconnected. (With an old uvicorn,
    messages wait in a queue.) If `see` is given, it gets the binary messages, one after the other.
    """
    heard_s = clock.now_s()

    def note(message: Any, handle: Callable[[Any], Any] = hear) -> Any:
        nonlocal heard_s
        heard_s = clock.now_s()
        note_use(websocket.scope, heard_s)
        return handle(message)

    async def receive() -> None:
        while (event := await websocket.receive())["type"] != "websocket.disconnect":
            text = event.get("text")
            if text is None and see is not None:
                await note(event["bytes"], see)
            else:
                note(event["bytes"] if text is None else text)

    async def close_when_idle(limit_s: float) -> None:
        while (left_s := heard_s + limit_s - clock.now_s()) > 0:
            await clock.pause(left_s)
        await websocket.close(1001, "idle for too long")

    async def show_out() -> None:
        await refusals.shut_out.wait()
        await clock.pause(_LAST_S)
        await websocket.close(1008, "too many refused messages")

    if (direct := fast_path(websocket)) is not None:
        direct.on_text = note
        if see is None:
            direct.on_bytes = note
    idle = () if idle_s is None else (close_when_idle(idle_s),)
    await end_with_either(receive(), sending, show_out(), *idle)


async def end_with_either(*parts: Coroutine[Any, Any, None]) -> None:
    """Run the parts of a websocket until one of them ends or the client disconnects."""
    try:
        await first_of(*parts)
    except Exception as error:
        if not _means_gone(error):
            raise


async def first_of(*works: Coroutine[Any, Any, object]) -> None:
    """Run coroutines until one ends, and cancel the others. Raise the error of the ended one."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    for task in done:
        task.result()


def _means_gone(error: Exception) -> bool:
    """True if the error means that the client has disconnected, in any version of uvicorn."""
    if isinstance(error, RuntimeError):
        return "close" in str(error) or "ASGI message" in str(error)
    return isinstance(error, WebSocketDisconnect | OSError) or type(error).__name__ in _GONE
