"""Runs the third-party client `pybricksdev` with the stand-in of a hub; its folder is on the path.

Prints what it received, as JSON.
"""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace

import bleak

from tests.standins.pybricks_hub import FakeHub


async def talk(hub: FakeHub) -> dict[str, object]:
    from pybricksdev.connections.pybricks import PybricksHubBLE

    client = PybricksHubBLE(SimpleNamespace(name=hub.name))
    client.print_output, client._enable_line_handler = False, True
    seen: list[int] = []
    client.status_observable.subscribe(lambda status: seen.append(int(status)))
    await client.connect()
    await client.start_user_program()
    answers = []
    for line in ("?", "forward 400 0.5 1 0", "left 400 1 2 0"):
        await client.write_line(line)
        answers.append(await client.read_line())
    try:
        await client.start_user_program()
        refused = ""
    except Exception as error:
        refused = type(error).__name__
    await client.stop_user_program()
    await asyncio.sleep(0)
    await client.disconnect()
    return {"answers": answers, "told": hub.told, "status": seen, "refused": refused}


if __name__ == "__main__":
    with FakeHub() as hub:
        bleak.BleakClient = hub.bluetooth.BleakClient
        print(json.dumps(asyncio.run(talk(hub))))
