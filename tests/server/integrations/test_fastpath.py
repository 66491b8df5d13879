"""The fast path of uvicorn's websocket protocol, over a connection in memory."""

import asyncio
import random
from types import SimpleNamespace
from typing import Any

import pytest
import uvicorn
from uvicorn.server import ServerState

from server.integrations.fastpath import BURST_S, FRAME_S, make_protocol


async def accept_and_wait(scope: Any, receive: Any, send: Any) -> None:
    await receive()
    await send({"type": "websocket.accept"})
    while (await receive())["type"] != "websocket.disconnect":
        pass


class Line(asyncio.Transport):
    """One end of a connection in memory."""

    is_read, is_closed, written = True, False, b""

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return default

    def is_closing(self) -> bool:
        return self.is_closed

    def write(self, data: Any) -> None:
        self.written += data

    def close(self) -> None:
        self.is_closed = True

    def pause_reading(self) -> None:
        self.is_read = False

    def resume_reading(self) -> None:
        self.is_read = True


PING, STOP_TEXT = bytes([0x89, 0x80, 0, 0, 0, 0]), '{"type":"stop"}'
BEGUN, MORE, LAST = (bytes([first, 0x80, 0, 0, 0, 0]) for first in (0x01, 0x00, 0x80))
FLOODS = {
    "pings": (b"", PING, 300),
    "pongs": (b"", bytes([0x8A]) + PING[1:], 300),
    "texts": (b"", bytes([0x81]) + PING[1:], 300),
    "texts, each in a packet": (b"", bytes([0x81]) + PING[1:], 1),
    "one message in parts for ever": (BEGUN, MORE, 300),
    "messages in two parts": (b"", BEGUN + LAST, 300),
}


@pytest.mark.parametrize("flood", FLOODS)
def test_a_flooding_client_is_read_no_faster_than_a_page_needs(flood):
    """In an earlier version, a pupil with eight sockets delayed the pilot and every STOP by fifteen
    seconds."""
    asyncio.run(flood_for_a_minute(*FLOODS[flood]))


async def connected(line: Line) -> tuple[Any, list[str | bytes]]:
    """Return a protocol after its handshake, and the list of the messages that it receives."""
    protocol_type = make_protocol()
    if protocol_type is None:
        pytest.skip("this uvicorn has no fast path")
    config, state = uvicorn.Config(accept_and_wait, ws_ping_interval=None), ServerState()
    config.load()
    protocol = protocol_type(config=config, server_state=state, app_state={})
    protocol.connection_made(line)
    head = "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    protocol.data_received((head + key).encode())
    while not protocol.handshake_complete:
        await asyncio.sleep(0)
    heard: list[str | bytes] = []
    protocol.on_text = protocol.on_bytes = heard.append
    return protocol, heard


def masked(first: int, data: bytes, rng: random.Random) -> bytes:
    """Return a client's frame."""
    size = len(data)
    length = bytes([0x80 | size]) if size < 126 else bytes([0xFE]) + size.to_bytes(2, "big")
    mask = rng.randbytes(4)
    return bytes([first]) + length + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data))


@pytest.mark.parametrize("leaves", [True, False])
def test_a_server_ends_cleanly_while_a_client_leaves(leaves):
    async def end() -> None:
        line = Line()
        protocol, _ = await connected(line)
        if leaves:
            protocol.data_received(masked(0x88, b"\x03\xe8", random.Random(1)))
            assert line.is_closing()
        protocol.shutdown()
        assert line.is_closing()
        code = 1000 if leaves else 1012
        assert line.written.endswith(bytes([0x88, 2]) + code.to_bytes(2, "big"))

    asyncio.run(end())


@pytest.mark.parametrize("seed", range(6))
def test_messages_are_heard_alike_however_the_network_cuts_them(seed):
    """Short messages bypass the parser only if the parser holds no earlier bytes."""
    asyncio.run(cut_at_random(random.Random(seed)))


async def cut_at_random(rng: random.Random) -> None:
    protocol, heard = await connected(Line())
    frames, sent = [], []
    for _ in range(40):
        data = rng.randbytes(rng.choice((0, 1, 8, 124, 125, 126, 300))).hex().encode()
        data = data[: rng.choice((0, 8, 125, 126, 400))]
        kind = rng.choice((0x81, 0x82, 0x82, 0x81, 0x89))
        if kind != 0x89:
            sent.append(data.decode() if kind == 0x81 else data)
        frames.append(masked(kind, data[:125] if kind == 0x89 else data, rng))
    while frames:
        piece = b"".join(frames[: (n := rng.choice((1, 1, 1, 2, 3)))])
        frames = frames[n:]
        cuts = sorted(
            rng.sample(range(1, len(piece)), min(len(piece) - 1, rng.choice((0, 0, 1, 3))))
        )
        for start, stop in zip((0, *cuts), (*cuts, len(piece)), strict=True):
            protocol.data_received(piece[start:stop])
    assert heard == sent
    posing = masked(0x81, b"a part that looks like a message", rng)
    frame = bytes([0x82, 0xFE, 0, 4 * len(posing), 0, 0, 0, 0]) + 4 * posing
    for start in range(8 - len(posing), len(frame), len(posing)):
        protocol.data_received(frame[max(0, start) : start + len(posing)])
    frame = masked(0x82, bytes(300), rng)
    protocol.data_received(frame[:132])  # the size of a frame of length 126
    protocol.data_received(frame[132:])
    sent += [4 * posing, bytes(300)]
    assert heard == sent
    protocol.data_received(BEGUN)  # a new message within a fragmented one is an error
    protocol.data_received(masked(0x81, b"amid", rng))
    protocol.data_received(masked(0x81, b"after the error", rng))
    assert heard == sent


async def flood_for_a_minute(first: bytes, again: bytes, n_at_a_time: int) -> None:
    line = Line()
    protocol, heard = await connected(line)

    stop = bytes([0x81, 0x80 | len(STOP_TEXT), 0, 0, 0, 0]) + STOP_TEXT.encode()
    now_s = began_s = protocol.loop.time()
    later: list[Any] = []
    protocol.loop = SimpleNamespace(
        time=lambda: now_s, call_later=lambda wait_s, call: later.append((now_s + wait_s, call))
    )
    protocol.data_received(700 * PING + stop)
    assert heard == [STOP_TEXT], "a burst is read completely"

    n_frames, piece = 0, again * n_at_a_time
    protocol.data_received(first)
    while now_s < began_s + 60.0:
        while line.is_read:
            protocol.data_received(piece)
            n_frames += len(piece) // len(PING)
            await asyncio.sleep(0)  # the application reads the received messages
            await asyncio.sleep(0)
            assert n_frames < (now_s - began_s + BURST_S) / FRAME_S + 1000
        now_s, call = later.pop(0)
        call()
    assert len(getattr(protocol, "frames", ())) < 10, "fragments without an end are not collected"
