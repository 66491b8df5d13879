#!/bin/sh
# aiocoap 0.4.17: an observer of a robot receives nothing more after the robot was switched off and on, and gets no
# error.
#
# Guess before running: a robot's answer is valid for two seconds (Max-Age). If nothing new arrives in this time, the
# observation asks again, as RFC 7641 (3.3.1) allows, or ends with an error.
# Outcome: wrong. The robot has forgotten its observers, and the observer waits forever, without an error. This script
# waits for 12 seconds, six times the Max-Age. A stopped program therefore looks like a value that does not change,
# such as "the way is free". Another program that asks gets the new value immediately. An observer has to measure the
# time itself, and to ask again after the Max-Age.
#
# Our connections report several times a second, and a robot whose reports end is stopped.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check aiocoap==0.4.17
cd "$folder"
cat > robot.py <<'PY'
import asyncio
import sys

import aiocoap
from aiocoap.resource import ObservableResource, Site


class Way(ObservableResource):
    def __init__(self, first: int) -> None:
        super().__init__()
        self.number = first

    async def render_get(self, request: aiocoap.Message) -> aiocoap.Message:
        return aiocoap.Message(payload=str(self.number).encode(), max_age=2)


async def main() -> None:
    way, site = Way(int(sys.argv[2])), Site()
    site.add_resource(["way"], way)
    await aiocoap.Context.create_server_context(site, bind=("127.0.0.1", int(sys.argv[1])))
    while True:
        await asyncio.sleep(0.2)
        way.number += 1
        way.updated_state()


asyncio.run(main())
PY
"$folder/env/bin/python" - <<'PY'
import asyncio
import contextlib
import socket
import subprocess
import sys

import aiocoap

SILENT_S = 12.0
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
uri = f"coap://127.0.0.1:{port}/way"


async def value(other: aiocoap.Context) -> int:
    """Ask until the robot answers; return its number."""
    while True:
        with contextlib.suppress(aiocoap.error.Error):
            return int((await other.request(aiocoap.Message(code=aiocoap.GET, uri=uri)).response).payload)
        await asyncio.sleep(0.5)


async def main() -> None:
    here, other = [await aiocoap.Context.create_client_context() for _ in range(2)]
    robot = subprocess.Popen([sys.executable, "robot.py", str(port), "0"])
    try:
        await value(other)
        asked = here.request(aiocoap.Message(code=aiocoap.GET, uri=uri, observe=0))
        await asked.response
        heard = asked.observation.__aiter__()
        seen = [int((await heard.__anext__()).payload) for _ in range(5)]
        robot.kill()
        robot.wait()
        robot = subprocess.Popen([sys.executable, "robot.py", str(port), "1000"])
        now = await value(other)
        late = []
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(SILENT_S):
                while not late or late[-1] < 1000:
                    late.append(int((await heard.__anext__()).payload))
        print(f"observed: {seen}; after the restart: {late}, nothing new within {SILENT_S} s; asked: {now}")
        assert seen == sorted(seen) and now >= 1000 and all(number < 1000 for number in late)
    finally:
        robot.kill()
        robot.wait()
    for context in (here, other):
        await context.shutdown()


asyncio.run(main())
PY
