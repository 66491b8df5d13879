#!/bin/sh
# python-socketio 5.18.1: a stop that was sent after a speed can be handled before it.
#
# Guess before running: the events of one client are handled one after the other, in the order in which they arrive,
# like a websocket's messages in a loop.
# Outcome: wrong. By default (async_handlers) each event gets its own task, or its own thread in the server without
# asyncio. If a handler awaits something before it sets the motors, such as a lock or a line of a log, the next event
# overtakes it. Of "drive 0.5" and "drive 0" from one phone, 0.5 is set last, and the robot drives on. With
# async_handlers=False the order is kept.
#
# Our server handles the messages of one connection one after the other.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check python-socketio==5.18.1 aiohttp==3.14.5
"$folder/env/bin/python" - <<'PY'
import asyncio

import socketio
from aiohttp import web


async def drive(**options: bool) -> list[float]:
    server, app = socketio.AsyncServer(async_mode="aiohttp", **options), web.Application()
    server.attach(app)
    speeds = []

    @server.event
    async def drive(_: str, speed: float) -> None:
        if speed:
            await asyncio.sleep(0.1)  # a line of a log
        speeds.append(speed)

    runner = web.AppRunner(app)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    port = site._server.sockets[0].getsockname()[1]
    phone = socketio.AsyncClient()
    await phone.connect(f"http://127.0.0.1:{port}", transports=["websocket"])
    await phone.emit("drive", 0.5)
    await phone.emit("drive", 0.0)
    await asyncio.sleep(1.0)
    await phone.disconnect()
    await runner.cleanup()
    return speeds


by_default, in_order = asyncio.run(drive()), asyncio.run(drive(async_handlers=False))
print("speeds set, by default:", by_default, "with async_handlers=False:", in_order)
assert by_default == [0.0, 0.5] and in_order == [0.5, 0.0]
PY
