#!/bin/sh
# python-osc 1.10.2: a phone whose clock is two seconds ahead stops the whole asyncio program for two seconds.
#
# Guess before running: AsyncIOOSCUDPServer keeps a bundle until the time in its tag, and everything else goes on.
# Outcome: wrong. It calls time.sleep() in the event loop, although the dispatcher has a second, asynchronous way that
# would not. In the meantime no other task runs, so a control loop stands still and no "/stop" is read. Each such bundle
# stops it again. ThreadingOSCUDPServer reads on. Dispatcher(strict_timing=False) does not wait.
#
# Our servers do not speak OSC.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check python-osc==1.10.2
"$folder/env/bin/python" - <<'PY'
import asyncio
import time

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_bundle_builder import OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_server import AsyncIOOSCUDPServer
from pythonosc.udp_client import SimpleUDPClient

AHEAD_S = 2.0


def steering() -> object:
    message = OscMessageBuilder("/steer")
    message.add_arg(0.5)
    bundle = OscBundleBuilder(time.time() + AHEAD_S)
    bundle.add_content(message.build())
    return bundle.build()


async def longest_tick_s(**options: bool) -> float:
    heard = []
    dispatcher = Dispatcher(**options)
    dispatcher.set_default_handler(lambda address, *values: heard.append(address))
    server = AsyncIOOSCUDPServer(("127.0.0.1", 0), dispatcher, asyncio.get_running_loop())
    transport, _ = await server.create_serve_endpoint()
    phone = SimpleUDPClient("127.0.0.1", transport.get_extra_info("sockname")[1])
    longest_s, last_s = 0.0, time.monotonic()
    for tick in range(30):
        if tick == 5:
            phone.send(steering())
        await asyncio.sleep(0.02)
        now_s = time.monotonic()
        longest_s, last_s = max(longest_s, now_s - last_s), now_s
    transport.close()
    assert heard == ["/steer"]
    return longest_s


found = {
    "by default": round(asyncio.run(longest_tick_s()), 2),
    "strict_timing=False": round(asyncio.run(longest_tick_s(strict_timing=False)), 2),
}
print("longest tick of .02 s, in seconds:", found)
assert found["by default"] > 0.8 * AHEAD_S and found["strict_timing=False"] < 0.4 * AHEAD_S
PY
