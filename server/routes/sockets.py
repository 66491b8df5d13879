"""What both websockets have in common: reading until they end, and ending cleanly."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect

from robot.clock import Clock
from server.hosting.uvicorn_fastpath import EXTENSION, FastPath

_LAST_S = 1.0
"""So long a client that is shown out is still read."""


async def received(
    websocket: WebSocket, idle_s: float, is_idle: Callable[[], bool] = lambda: True
) -> AsyncIterator[dict[str, Any]]:
    """Yield messages until the client disconnects, or has sent nothing for `idle_s`; `is_idle` is
    false of one that has, where messages are read by another way."""
    while True:
        try:
            message = dict(await asyncio.wait_for(websocket.receive(), idle_s))
        except TimeoutError:
            if not is_idle():
                continue
            await websocket.close(1001, "idle for too long")
            return
        if message["type"] == "websocket.disconnect":
            return
        yield message


def hear_at_once(websocket: WebSocket, hear: Callable[[str], None]) -> None:
    """Have texts heard where bytes become messages, before all queues, and while it closes.

    Where uvicorn is too old for that, they come in their turn.
    """
    direct: FastPath | None = websocket.scope.get("extensions", {}).get(EXTENSION)
    if direct is not None:
        direct.on_text = hear


async def show_out(websocket: WebSocket, clock: Clock, shut_out: asyncio.Event) -> None:
    """Close a socket of which too much was refused. In what it has sent, STOP is still heard."""
    await shut_out.wait()
    await clock.pause(_LAST_S)
    await websocket.close(1008, "too many refused messages")


async def end_with_either(*parts: Coroutine[Any, Any, None]) -> None:
    """Run both directions of a socket; when one ends or the client disconnects, end the other."""
    tasks = [asyncio.create_task(part) for part in parts]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        for result in await asyncio.gather(*tasks, return_exceptions=True):
            if isinstance(result, Exception) and not _means_gone(result):
                raise result


def _means_gone(error: Exception) -> bool:
    """True for the errors by which any server version reports a client that disconnected."""
    if isinstance(error, RuntimeError):
        return "close" in str(error) or "ASGI message" in str(error)
    return isinstance(error, WebSocketDisconnect | OSError) or type(error).__name__ in _GONE


_GONE = ("ClientDisconnected", "ConnectionClosed", "ConnectionClosedOK", "ConnectionClosedError")
