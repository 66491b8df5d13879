"""A flood from an unpaired program locks nobody out while a paired pilot drives."""

from __future__ import annotations

import asyncio
import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.clock import RealClock
from server.protocol import encode_acknowledgement, parse_picture
from tests.server.access.unpaired_flood import HALF_REQUESTS, IDLE, PATIENCE_S, WRONG_TOKENS
from tests.server.lan_process import Process, lan_process
from tests.server.test_stop_always import check_who_takes_all_places_holds_up_no_stop

client = pytest.importorskip(
    "websockets.asyncio.client", reason="Debian 12's websockets has it not"
)

pytestmark = pytest.mark.realtime

MOST_LOG_BYTES = 100_000
RECONNECTS = 10


@pytest.fixture
def lan(tmp_path: Path) -> Iterator[tuple[Process, Path]]:
    log = tmp_path / "log"
    with lan_process(log) as process:
        yield process, log


class Phone:
    """A paired pilot that holds forward, and starts again whenever the robot stands."""

    def __init__(self, server: Process, cookie: str) -> None:
        self._server, self._cookie = server, cookie
        self.seq = self.states = self.driven = self.connections = 0
        self.sight: dict[str, int] = {}
        self.mode = ""

    async def drive(self) -> None:
        """Drive until cancelled; connect again after a lost connection."""
        while True:
            with contextlib.suppress(OSError, EOFError, Exception):
                await self._drive_once()
            await asyncio.sleep(0.25)

    async def _open(self, path: str) -> Any:
        return await client.connect(
            f"ws://127.0.0.1:{self._server.port}{path}",
            additional_headers={"Cookie": self._cookie},
            compression=None,
        )

    async def _drive_once(self) -> None:
        drive, video = await self._open("/ws/drive"), await self._open("/ws/video")
        self.connections += 1
        self.seq = 0
        parts = [
            asyncio.create_task(part)
            for part in (self._hear(drive), self._see(video), self._beat(drive))
        ]
        try:
            await asyncio.wait(parts, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for part in parts:
                part.cancel()
            await asyncio.gather(*parts, return_exceptions=True)
            await drive.close()
            await video.close()

    async def _hear(self, drive: Any) -> None:
        async for text in drive:
            message = json.loads(text)
            if message["type"] == "state":
                self.states += 1
                self.mode = message["mode"]
                self.driven += self.mode == "train"

    async def _see(self, video: Any) -> None:
        async for message in video:
            assert isinstance(message, bytes)
            picture = parse_picture(message)
            self.sight = {"frame": picture.frame_id, "nonce": picture.nonce}
            await video.send(encode_acknowledgement(picture.frame_id))

    async def _beat(self, drive: Any) -> None:
        while True:
            await asyncio.sleep(0.1)
            self.seq += 1
            command = {"type": "drive", "held": "forward", **self.sight, "seq": self.seq}
            await drive.send(json.dumps(command))
            if self.mode == "stopped" and self.sight:
                self.seq += 1
                again = {"type": "mode", "mode": "train", **self.sight, "seq": self.seq}
                await drive.send(json.dumps(again))


@pytest.mark.timeout(900)
def test_a_flood_neither_stops_the_pilot_nor_locks_out_a_new_phone(
    lan: tuple[Process, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "greedy").mkdir()
    check_who_takes_all_places_holds_up_no_stop(tmp_path / "greedy", capsys)
    server, log = lan
    the_right_token_is_admitted_whoever_tried_wrong_ones(server)
    clock = RealClock()

    async def come_back(
        phone: Phone, driving: asyncio.Task[None], took_s: list[float]
    ) -> asyncio.Task[None]:
        """Cut a phone's connection, and connect again until the first state arrives."""
        driving.cancel()
        await asyncio.gather(driving, return_exceptions=True)
        cut_s, before = clock.now_s(), phone.states
        driving = asyncio.create_task(phone.drive())
        while phone.states == before:
            await asyncio.sleep(0.005)
        took_s.append(clock.now_s() - cut_s)
        return driving

    async def scenario() -> tuple[Phone, int, list[float]]:
        phone = Phone(server, await asyncio.to_thread(server.pair))
        driving = asyncio.create_task(phone.drive())
        while phone.mode != "train":
            await asyncio.sleep(0.05)
        attack = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "tests.server.access.unpaired_flood",
            server.address,
            stdout=subprocess.PIPE,
        )
        attacking = asyncio.create_task(attack.communicate())
        while server.ask()["evicted"] < 100:
            await asyncio.sleep(0.05)
        before = phone.driven
        # A new connection during the flood.
        second = Phone(server, await asyncio.to_thread(server.pair))
        coming = asyncio.create_task(second.drive())
        while not second.states:
            await asyncio.sleep(0.05)
        back_s: list[float] = []
        while len(back_s) < RECONNECTS and not attacking.done():
            coming = await come_back(second, coming, back_s)
        coming.cancel()
        await asyncio.gather(coming, return_exceptions=True)
        assert back_s, "the attack was over before it mattered"
        ended = int((await attacking)[0])
        assert phone.driven > before + 20, "it was stopped as long as the attack lasted"
        before = phone.states
        while phone.states < before + 20 or phone.mode != "train":
            await asyncio.sleep(0.05)
        driving.cancel()
        await asyncio.gather(driving, return_exceptions=True)
        return phone, ended, back_s

    phone, ended, back_s = asyncio.run(asyncio.wait_for(scenario(), 10 * PATIENCE_S))
    notes = server.ask()
    with capsys.disabled():
        print(f"\nflood: {notes}, log {log.stat().st_size} B, lines {phone.connections}")
        print(f"back in {[round(1000 * one_s) for one_s in back_s]} ms; a page waits 250 first")
    assert phone.connections == 1, "the pilot's line was cut"
    assert ended > 0.9 * (HALF_REQUESTS + IDLE), "pending connections are not closed"
    assert notes["evicted"] > 0
    assert log.stat().st_size < MOST_LOG_BYTES, log.read_text()[-2000:]


def the_right_token_is_admitted_whoever_tried_wrong_ones(server: Process) -> None:
    wrong = [
        httpx.post(server.address + "/api/pair", json={"token": "WRONG"}).status_code
        for _ in range(WRONG_TOKENS)
    ]
    assert wrong[0] == 403 and wrong[-1] == 429
    assert server.pair()
