#!/bin/sh
# websockets 17.4: the keep-alive of a client that only sends closes the connection once 17 messages wait unread.
#
# Guess before running: pings are answered in the background, so a robot that sends its state and never calls recv()
# stays connected. Answers that nobody reads are dropped or kept.
# Outcome: wrong. 16 unread messages do no harm. With the 17th the client stops reading, so it does not see the answer
# to its own ping either. It then closes a connection on which the server answers immediately, with "1011 keepalive
# ping timeout" (after 40 s by default). The error message suggests a fault of the network, so nobody suspects the
# unread messages. Clients of `websockets.sync` behave in the same way. A test in which the server sends little
# passes.
#
# Our clients read all the time, each in its own loop.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check websockets==17.4
"$folder/env/bin/python" - <<'PY'
import asyncio
import logging
import time

from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosedError

SENT_FOR_S = 4.0
logging.disable(logging.CRITICAL)


async def drive(address: str, n_answered: int) -> str:
    async with connect(address, ping_interval=0.5, ping_timeout=0.5) as line:
        began_s, sent = time.monotonic(), 0
        while time.monotonic() - began_s < SENT_FOR_S:
            try:
                await line.send("answer" if sent < n_answered else "state")
            except ConnectionClosedError as error:
                return f"closed: {error}"
            sent += 1
            await asyncio.sleep(0.02)
    return "open"


async def main() -> dict[int, str]:
    async def answer(line: ServerConnection) -> None:
        async for message in line:
            if message == "answer":
                await line.send("ok")

    async with serve(answer, "127.0.0.1", 0, ping_interval=None) as server:
        address = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        return {n: await drive(address, n) for n in (16, 17)}


found = asyncio.run(main())
print("by number of unread answers:", found)
assert found[16] == "open" and "1011" in found[17] and "keepalive ping timeout" in found[17]
PY
