"""An unpaired program that floods a server, in a separate process; for test_unpaired_flood.py.

The program prints how many of its half requests and idle connections the server has closed.
"""

import contextlib
import socket
import sys

import httpx

from tests.kit.sizes import size

CONNECTS = size("CONNECTS", 1_500, 5_000)
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
    except OSError:  # a reset
        pass
    return True


def attack(server: str) -> int:
    """Send the whole flood; return how many pending connections the server closed."""
    address = ("127.0.0.1", int(server.rsplit(":", 1)[1]))
    pending = []
    for number in range(CONNECTS + HALF_REQUESTS + IDLE):
        with contextlib.suppress(OSError):
            line = socket.create_connection(address, PATIENCE_S, (OWN_ADDRESS, 0))
            if number < CONNECTS:
                line.close()
                continue
            pending.append(line)
            if number < CONNECTS + HALF_REQUESTS:
                line.sendall(HALF[number % 3])
    transport = httpx.HTTPTransport(local_address=OWN_ADDRESS)
    with httpx.Client(timeout=PATIENCE_S, transport=transport) as client:
        for _ in range(WRONG_TOKENS):
            with contextlib.suppress(httpx.HTTPError):
                client.post(server + "/api/pair", json={"token": "WRONG"})
    return sum(map(is_closed, pending))


if __name__ == "__main__":
    import resource  # not on Windows

    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    print(attack(sys.argv[1]))
