"""Browsers connect, drive and vanish, over and over, and leave nothing behind.

DRIVELESSON_SOAK is the number of browsers, after half as many to warm up; `make test` takes 60, CI
2,000. All teaching is dropped before memory is measured, because a history grows to its bound with
the time driven.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
from pathlib import Path
from typing import Any

import pytest

from server.lab.bench.subject import ServerUnderTest
from server.protocol import encode_acknowledgement, parse_picture
from tests.kit.sizes import size

pytest.importorskip("websockets.asyncio.client", reason="Debian 12's websockets has it not")
from websockets.asyncio.client import connect

pytestmark = pytest.mark.realtime

VISITS = size("SOAK", 60, 2_000)
AT_A_TIME = 20
MOST_GROWTH_BYTES = 5_000_000
MOST_OBJECTS_A_VISIT = 20  # one page with its socket and its queues is 350


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_vanished_browsers_leave_nothing_behind() -> None:
    with ServerUnderTest("drivelesson", 30.0) as subject:
        empty = left_over(subject)
        asyncio.run(visits(subject.port, VISITS // 2))
        assert asyncio.run(settled(subject, empty)) == empty
        before = subject.ask("forget")
        asyncio.run(visits(subject.port, VISITS))
        assert asyncio.run(settled(subject, empty)) == empty
        after = subject.ask("forget")
        grown_bytes = after["resident_bytes"] - before["resident_bytes"]
        assert after["blocks"] - before["blocks"] < MOST_OBJECTS_A_VISIT * VISITS
        assert grown_bytes < MOST_GROWTH_BYTES
        assert subject.ask()["cycle_hz"] > 0, "the loop goes on"
        print(f"{VISITS} visits: grown by {grown_bytes / 1e6:.2f} MB")


async def visits(port: int, count: int) -> None:
    dice, gate = random.Random(count), asyncio.Semaphore(AT_A_TIME)

    async def visit(number: int) -> None:
        async with gate:
            with contextlib.suppress(OSError, EOFError, TimeoutError):
                await asyncio.wait_for(visit_once(port, dice, number), 20)

    await asyncio.gather(*(visit(number) for number in range(count)))


async def visit_once(port: int, dice: random.Random, number: int) -> None:
    """Join, drive a little, and leave in one of the ways in which browsers leave."""
    options: dict[str, Any] = {"compression": None, "close_timeout": 1, "ping_interval": None}
    drive = await connect(f"ws://127.0.0.1:{port}/ws/drive", **options)
    video = await connect(f"ws://127.0.0.1:{port}/ws/video", **options)
    try:
        await drive.send('{"type":"take"}')
        for seq in range(2, dice.randint(3, 6)):
            picture = parse_picture(await video.recv(decode=False))
            await video.send(encode_acknowledgement(picture.frame_id))
            seen = {"frame": picture.frame_id, "nonce": picture.nonce, "seq": seq}
            start, hold = {"type": "mode", "mode": "train"}, {"type": "drive", "held": "left"}
            await drive.send(json.dumps((start if seq == 2 else hold) | seen))
            await drive.recv()
    finally:
        for socket, is_closed in ((drive, number % 3 == 0), (video, number % 3 != 1)):
            if is_closed:
                await socket.close()
            else:
                socket.transport.abort()
        for socket in (drive, video):
            with contextlib.suppress(Exception):
                await socket.wait_closed()


def left_over(subject: ServerUnderTest) -> dict[str, int]:
    notes = subject.ask()
    descriptors = len(list(Path(f"/proc/{subject.pid}/fd").iterdir()))
    return {"threads": notes["threads"], "tasks": notes["tasks"], "descriptors": descriptors}


async def settled(subject: ServerUnderTest, wanted: dict[str, int]) -> dict[str, int]:
    """Wait until nothing is left over, ten seconds at most."""
    for _ in range(100):
        if left_over(subject) == wanted:
            break
        await asyncio.sleep(0.1)
    return left_over(subject)
