#!/bin/sh
# zeroconf 0.154.0: if a robot announces "driving" for half a second, and then "idle" again, other programs read
# "driving" for 75 minutes.
#
# Guess before running: update_service() with other properties replaces the old ones everywhere, so another program
# reads the last state after at most a second (RFC 6762, 10.2).
# Outcome: wrong. "driving" is kept beside "idle", because a record that is less than a second old is not replaced,
# which is what the RFC says. But of the two records, the one that entered the cache last is read, and not the one
# that was received last. "idle" was in the cache before, so the answer is "driving" until it expires. If the last
# state is a new one, such as "stopped", or if more than a second has passed, the answer is right. A counter in the
# properties makes each state a new one.
#
# Our program announces no states, and withdraws its name before it announces another address.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet --disable-pip-version-check zeroconf==0.154.0
"$folder/env/bin/python" - <<'PY'
import asyncio
import os

from zeroconf.asyncio import AsyncServiceBrowser, AsyncServiceInfo, AsyncZeroconf

KIND = "_robot._udp.local."
NAME = f"robot-{os.getpid()}.{KIND}"


def robot(state: str) -> AsyncServiceInfo:
    address = bytes((127, 0, 0, 1))
    server, properties = f"robot-{os.getpid()}.local.", {"state": state}
    return AsyncServiceInfo(KIND, NAME, port=9, addresses=[address], server=server, properties=properties)


async def read_after(states: list[str], pause_s: float) -> str:
    """Announce these states one after the other; return the state that another program reads later."""
    here, there = AsyncZeroconf(interfaces=["127.0.0.1"]), AsyncZeroconf(interfaces=["127.0.0.1"])
    browser = AsyncServiceBrowser(there.zeroconf, KIND, handlers=[lambda **_: None])
    await (await here.async_register_service(robot(states[0])))
    await asyncio.sleep(3.0)
    for state in states[1:]:
        await (await here.async_update_service(robot(state)))
        await asyncio.sleep(pause_s)
    await asyncio.sleep(3.0)
    info = AsyncServiceInfo(KIND, NAME)
    assert await info.async_request(there.zeroconf, 1000)
    await browser.async_cancel()
    await there.async_close()
    await here.async_close()
    return (info.properties[b"state"] or b"").decode()


async def main() -> None:
    back = await read_after(["idle", "driving", "idle"], 0.0)
    later = await read_after(["idle", "driving", "idle"], 2.0)
    new = await read_after(["idle", "driving", "stopped"], 0.0)
    print(f"idle again at once: {back}; idle again after two seconds: {later}; stopped at once: {new}")
    assert (back, later, new) == ("driving", "idle", "stopped")


asyncio.run(main())
PY
