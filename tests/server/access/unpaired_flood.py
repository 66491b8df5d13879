"""An unpaired program that floods a server, in a separate process; for test_unpaired_flood.py."""

from __future__ import annotations

import asyncio
import contextlib
import sys

import httpx

from tests.kit.sizes import size

CONNECTS = size("CONNECTS", 1_500, 5_000)
HALF_REQUESTS, IDLE, WRONG_TOKENS = 500, 700, 12
PATIENCE_S = 30.0
OWN_ADDRESS = "127.0.0.2"
"""An address other than the pilot's, on the same machine."""


async def _closed(reader: asyncio.StreamReader) -> bool:
    with contextlib.suppress(OSError):
        await reader.read(65_536)
    return True


async def _attack(server_address: str) -> int:
    """Send the whole flood; return how many idle and half-open connections the server closed."""
    address = ("127.0.0.1", int(server_address.rsplit(":", 1)[1]))
    open_ones: list[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = []
    for number in range(CONNECTS):
        with contextlib.suppress(OSError):
            _, writer = await asyncio.open_connection(*address, local_addr=(OWN_ADDRESS, 0))
            writer.close()
        if number % 100 == 0:
            await asyncio.sleep(0)
    for number in range(HALF_REQUESTS + IDLE):
        with contextlib.suppress(OSError):
            reader, writer = await asyncio.open_connection(*address, local_addr=(OWN_ADDRESS, 0))
            open_ones.append((reader, writer))
            if number < HALF_REQUESTS:
                half = (
                    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ",
                    b"POST /api/pair HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99\r\n\r\n{",
                    b"GET /ws/drive HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n",
                )[number % 3]
                writer.write(half)
    transport = httpx.AsyncHTTPTransport(local_address=OWN_ADDRESS)
    async with httpx.AsyncClient(timeout=PATIENCE_S, transport=transport) as client:
        for _ in range(WRONG_TOKENS):
            with contextlib.suppress(httpx.HTTPError):
                await client.post(server_address + "/api/pair", json={"token": "WRONG"})
    ends = await asyncio.wait_for(
        asyncio.gather(*(_closed(reader) for reader, _ in open_ones)), PATIENCE_S
    )
    for _, writer in open_ones:
        writer.close()
    return sum(ends)


if __name__ == "__main__":
    import resource  # not on Windows

    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    print(asyncio.run(_attack(sys.argv[1])))
