"""What both websockets have in common: reading until they end, and ending cleanly."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine
from typing import Any

from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect


async def received(websocket: WebSocket, idle_s: float) -> AsyncIterator[dict[str, Any]]:
    """Yield messages until the client goes, or has said nothing for `idle_s`."""
    event_loop = asyncio.get_running_loop()
    last_s = event_loop.time()
    me = asyncio.current_task()

    def look() -> None:
        nonlocal timer
        if event_loop.time() - last_s >= idle_s and me is not None:
            me.cancel()
        else:
            timer = event_loop.call_later(idle_s, look)

    timer = event_loop.call_later(idle_s, look)
    try:
        while True:
            message = dict(await websocket.receive())
            if message["type"] == "websocket.disconnect":
                return
            last_s = event_loop.time()
            yield message
    finally:
        timer.cancel()


async def end_with_either(*parts: Coroutine[Any, Any, None]) -> None:
    """Run both directions of a socket; when one ends, or the client goes, so does the other."""
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
    """True for the errors by which servers of all versions say that the client is gone."""
    return isinstance(error, WebSocketDisconnect | RuntimeError | OSError) or (
        type(error).__name__ in ("ClientDisconnected", "ConnectionClosed", "ConnectionClosedOK",
                                 "ConnectionClosedError")
    )
