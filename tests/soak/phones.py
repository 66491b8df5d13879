"""Kills a server that phones watch, starts it again, and measures when they see again: outside CI.

`python -m tests.soak.phones --phones 60`, and with `--tls`: a real server with the simulator, and
paired phones that connect and retry like the page. The server is killed (SIGKILL) and started at
once. The report has the time until each phone has a new picture, from the kill and from the moment
at which the server listens again, which depends on the load of the machine. The exit status is 1
if a phone was not back within `--within` seconds after that moment.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import ssl
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect
from websockets.exceptions import InvalidHandshake, WebSocketException

from server.access.config import NetworkConfig
from server.access.pairing import Paired, Pairing, cookie_name
from server.gateway.roles import Role
from server.protocol import encode_acknowledgement, parse_picture
from tests.kit.ports import free_port
from tests.soak.measured import measure_process
from tests.soak.served import ROOT

FIRST_RETRY_S, LAST_RETRY_S = 0.25, 2.0
"""The page's pauses before it connects again, in seconds; see `web/js/connection.js`."""
GIVE_UP_S = 300.0


class Phone:
    """One paired phone, with the sockets of a page.

    Attributes:
        seen_s: The time of the newest picture, in seconds.
        refusals: The HTTP statuses with which connections were refused.
    """

    def __init__(self, url: str, headers: dict[str, str], trust: ssl.SSLContext | None) -> None:
        self._url = url
        self._options: dict[str, Any] = {"additional_headers": headers, "ssl": trust}
        self.seen_s = 0.0
        self.refusals: list[str] = []

    async def live(self) -> None:
        """Connect, and connect again when a connection ends."""
        retry_s = FIRST_RETRY_S
        while True:
            try:
                async with connect(
                    f"{self._url}/ws/drive", compression=None, **self._options
                ) as drive:
                    watching = asyncio.create_task(self._watch())
                    try:
                        async for _ in drive:
                            retry_s = FIRST_RETRY_S
                    finally:
                        watching.cancel()
                        await asyncio.gather(watching, return_exceptions=True)
            except (OSError, WebSocketException, TimeoutError) as error:
                if isinstance(error, InvalidHandshake):
                    response = getattr(error, "response", None)
                    self.refusals.append(f"{error} {response.body if response else b''!r}")
            await asyncio.sleep(retry_s)
            retry_s = min(2 * retry_s, LAST_RETRY_S)

    async def _watch(self) -> None:
        while True:
            with contextlib.suppress(OSError, WebSocketException, TimeoutError):
                async with connect(
                    f"{self._url}/ws/video", compression=None, **self._options
                ) as video:
                    async for message in video:
                        assert isinstance(message, bytes)
                        self.seen_s = time.monotonic()
                        await video.send(encode_acknowledgement(parse_picture(message).frame_id))
            await asyncio.sleep(FIRST_RETRY_S)


def start(folder: Path, port: int, more: list[str]) -> subprocess.Popen[bytes]:
    words = ["serve", "--no-page", "--robot", "sim", "--lan", "--host", "127.0.0.1", *more]
    return subprocess.Popen(
        [sys.executable, "-m", "server", *words, "--port", str(port), "--data", str(folder)],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=(folder.parent / "log").open("ab"),
    )


def pair(folder: Path, port: int, count: int, *, tls: bool) -> list[dict[str, str]]:
    """Pair browsers with a server that will start on this folder; return their headers."""
    pairing = Pairing(10, file=folder / "paired.json")
    name = cookie_name(NetworkConfig(port=port, lan=True, tls=tls))
    found = []
    for number in range(count):
        paired = pairing.redeem(pairing.tokens[Role.PILOT], float(number))
        assert isinstance(paired, Paired)
        origin = f"{'https' if tls else 'http'}://127.0.0.1:{port}"
        found.append({"Cookie": f"{name}={paired.secret}", "Origin": origin})
    return found


async def listens(port: int) -> float:
    """Wait until the server accepts connections; return the time."""
    while True:
        with contextlib.suppress(OSError):
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.close()
            return time.monotonic()
        await asyncio.sleep(0.02)


async def all_see(phones: list[Phone], since_s: float) -> list[float]:
    """Wait until all phones have a picture that is newer; return the times of the first ones."""
    first: dict[int, float] = {}
    end_s = time.monotonic() + GIVE_UP_S
    while len(first) < len(phones):
        for number, phone in enumerate(phones):
            if number not in first and phone.seen_s > since_s:
                first[number] = phone.seen_s
        if time.monotonic() > end_s:
            missing = [one for number, one in enumerate(phones) if number not in first]
            raise SystemExit(f"{len(missing)} phones see nothing: {missing[0].refusals[-3:]}")
        await asyncio.sleep(0.01)
    return sorted(first.values())


async def measure(folder: Path, args: argparse.Namespace) -> bool:
    port = free_port()
    folder.mkdir()
    headers = pair(folder, port, args.phones, tls=args.tls)
    more, trust = ["--tls"] if args.tls else [], None
    if args.tls:
        trust = ssl.create_default_context()
        trust.check_hostname, trust.verify_mode = False, ssl.CERT_NONE
    url = f"{'wss' if args.tls else 'ws'}://127.0.0.1:{port}"
    server, is_good = start(folder, port, more), True
    phones = [Phone(url, one, trust) for one in headers]
    lives = [asyncio.create_task(phone.live()) for phone in phones]
    try:
        await all_see(phones, 0.0)
        for number in range(args.times):
            await asyncio.sleep(2.0)
            server.kill()
            server.wait()
            killed_s = time.monotonic()
            server = start(folder, port, more)
            began_s = await listens(port)
            began_cpu_s = measure_process(server.pid)["CPU s"]
            seen_s = await all_see(phones, killed_s)
            cpu_s = measure_process(server.pid)["CPU s"]
            middle, last = seen_s[len(seen_s) // 2], seen_s[-1]
            is_good = is_good and last - began_s <= args.within
            print(
                f"{number + 1}: the server listens {began_s - killed_s:.1f} s after the kill; then "
                f"half of {len(phones)} phones see after {middle - began_s:.1f} s, all after "
                f"{last - began_s:.1f} s (the server used {began_cpu_s:.1f} s of CPU time until it "
                f"listened, {cpu_s - began_cpu_s:.1f} s after that; load {os.getloadavg()[0]:.0f})",
                flush=True,
            )
        refused = sorted({sentence for phone in phones for sentence in phone.refusals})
        print(f"refused: {', '.join(refused) or 'none'}")
    finally:
        for life in lives:
            life.cancel()
        await asyncio.gather(*lives, return_exceptions=True)
        server.kill()
        server.wait()
    return is_good


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--phones", type=int, default=60)
    parser.add_argument("--times", type=int, default=3, help="kills")
    parser.add_argument("--tls", action="store_true")
    parser.add_argument("--within", type=float, default=5.0, metavar="S")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        return 0 if asyncio.run(measure(Path(name) / "data", args)) else 1


if __name__ == "__main__":
    sys.exit(main())
