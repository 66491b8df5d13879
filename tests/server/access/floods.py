"""Programs that flood a server, in separate processes; for test_unpaired_flood.py.

`floods unpaired PORT COUNT` opens and closes this many connections, sends what else an unpaired
program can send, and prints how many of its half requests and idle connections the server has
closed. `floods paired PORT COOKIE` holds as many connections of a paired browser as it can, and
sends as many messages as it can, until it is killed.
"""

import asyncio
import contextlib
import http.client
import socket
import sys

HALF_REQUESTS, IDLE, WRONG_TOKENS = 500, 700, 12
PATIENCE_S = 30.0
OWN_ADDRESS = "127.0.0.2"
"""An address other than the pilot's, on the same machine."""
HALF = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ",
    b"POST /api/pair HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99\r\n\r\n{",
    b"GET /ws/drive HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n",
)


def is_closed(line: socket.socket) -> bool:
    """Wait until the server closes a connection; False if it does not."""
    try:
        while line.recv(65_536):
            pass
    except TimeoutError:
        return False
    except OSError:  # the server has reset the connection
        pass
    return True


def unpaired(port: int, connects: int) -> int:
    """Send the whole flood; return how many pending connections the server closed."""
    pending = []
    for number in range(connects + HALF_REQUESTS + IDLE):
        with contextlib.suppress(OSError):
            line = socket.create_connection(("127.0.0.1", port), PATIENCE_S, (OWN_ADDRESS, 0))
            if number < connects:
                line.close()
                continue
            pending.append(line)
            if number < connects + HALF_REQUESTS:
                line.sendall(HALF[number % 3])
    client = http.client.HTTPConnection("127.0.0.1", port, PATIENCE_S, (OWN_ADDRESS, 0))
    for _ in range(WRONG_TOKENS):
        with contextlib.suppress(OSError, http.client.HTTPException):
            client.request("POST", "/api/pair", '{"token": "WRONG"}')
            client.getresponse().read()
    client.close()
    return sum(map(is_closed, pending))


SOCKETS, SILENT = 62, 510
_UPGRADE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
)
_PING = b'{"type":"ping","client_ms":1}'
_BURST = 700 * (bytes([0x81, 0x80 | len(_PING), 0, 0, 0, 0]) + _PING)
"""A burst of messages, masked with zeros so that a person can read them in a dump."""


async def paired(port: int, cookie: str) -> None:
    """Hold all connections until cancelled."""

    async def hold(path: str, more: str = "", burst: bytes = b"") -> None:
        """Hold one connection as long as the server allows, and then open the next one."""
        head = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: {cookie}\r\n{more}\r\n"
        while True:
            with contextlib.suppress(OSError, EOFError):
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                writer.write(head.encode() + burst)
                while await reader.read(65_536):
                    pass
                writer.close()
            await asyncio.sleep(2.0)

    async with asyncio.TaskGroup() as all_at_once:
        for number in range(SOCKETS):
            burst = _BURST if number % 8 == 0 else b""
            all_at_once.create_task(hold("/ws/drive", _UPGRADE, burst))
        for _ in range(SILENT):
            all_at_once.create_task(hold("/healthz"))


if __name__ == "__main__":
    import resource  # not on Windows

    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    if sys.argv[1] == "unpaired":
        print(unpaired(int(sys.argv[2]), int(sys.argv[3])))
    else:
        asyncio.run(paired(int(sys.argv[2]), sys.argv[3]))
