"""Joining the agent on a brick: both sides prove that they know the secret; then all is sealed."""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from robot.bodies.ev3.agent.wire import (
    FROM_AGENT,
    PORT,
    PROTOCOL,
    Seal,
    Unpacker,
    is_proof,
    pack_json,
    prove,
)
from robot.errors import ConfigurationError, DriveError

PATIENCE_S = 3.0
"""How long joining, or opening the body, may take."""
_BEFORE_PROOF = {b"J": 1024}


class BrickConnection:
    """One sealed connection to an agent that has proved that it is the right one.

    Raises:
        ValueError: On messages that were changed on the way or come from somebody else.
    """

    def __init__(self, line: socket.socket, unpacker: Unpacker, seal: Seal) -> None:
        self.line = line
        self._unpacker = unpacker
        self._seal = seal

    def send(self, message: dict[str, Any]) -> None:
        """Seal a message and send it; one thread at a time."""
        self.line.sendall(pack_json(message, self._seal))

    def receive(self) -> Iterator[tuple[bytes, bytes]]:
        """Wait for data, for as long as the line's timeout; yield what is whole."""
        data = self.line.recv(65536)
        if not data:
            raise OSError("the brick closed the connection")
        self._unpacker.feed(data)
        while (message := self._unpacker.next()) is not None:
            yield message

    def close(self) -> None:
        self.line.close()


def dial(address: tuple[str, int]) -> socket.socket:
    """Open a line to a host and port; whoever waits on it gives up after `PATIENCE_S`."""
    return socket.create_connection(address, timeout=PATIENCE_S)


def join(
    address: str, secret: str = "", dial: Callable[[tuple[str, int]], socket.socket] = dial
) -> BrickConnection:
    """Join the agent at `host` or `host:port`; with the kept secret unless one is given.

    Raises:
        ConfigurationError: If the address is none.
        DriveError: If nobody answers, the agent refuses, or it is another than ours.
    """
    host, _, port = address.partition(":")
    try:
        line = dial((host, int(port or PORT)))
    except ValueError:
        raise ConfigurationError(f"--brick {address} is no address:port") from None
    except OSError as error:
        raise DriveError(
            f"no agent answers at {host} port {port or PORT} ({error.strerror or error}); "
            f"start it with: drivelesson brick agent {host}"
        ) from error
    try:
        connection = _shake_hands(line, host, secret or kept_secret(host))
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    except DriveError:
        line.close()
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        line.close()
        raise DriveError(
            f"what answers at {host} port {port or PORT} is no agent of this version "
            f"({error}); renew it with: drivelesson brick agent {host}"
        ) from error
    return connection


def _shake_hands(line: socket.socket, host: str, secret: str) -> BrickConnection:
    unpacker = Unpacker(_BEFORE_PROOF)
    hello = _next_message(line, unpacker)
    if hello["hello"] != PROTOCOL:
        raise ValueError(f"it speaks version {hello['hello']}, this program version {PROTOCOL}")
    theirs, ours = str(hello["nonce"]), secrets.token_hex(16)
    proof = prove(secret, "controller", theirs, ours)
    line.sendall(pack_json({"do": "join", "nonce": ours, "proof": proof}))
    verdict = _next_message(line, unpacker)
    if "refused" in verdict:
        raise DriveError(
            f"the brick at {host} refuses: {verdict['refused']}; " + _advice(verdict, host)
        )
    if not is_proof(verdict["proof"], secret, "agent", theirs, ours):
        raise DriveError(
            f"what answers at {host} does not know the secret: it is not your brick; "
            "check the address, and who else is in this network"
        )
    unpacker.expect_seal(Seal(secret, "agent", theirs, ours), FROM_AGENT)
    return BrickConnection(line, unpacker, Seal(secret, "controller", theirs, ours))


def secret_path(host: str) -> Path:
    """Where `drivelesson brick agent` keeps the secret that it shares with a brick."""
    home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(home) / "drivelesson" / f"brick-{host}.secret"


def kept_secret(host: str) -> str:
    """Read the kept secret of a brick.

    Raises:
        DriveError: If there is none.
    """
    given = os.environ.get("DRIVELESSON_BRICK_SECRET")
    if given:
        return given
    try:
        return secret_path(host).read_text().strip()
    except OSError:
        raise DriveError(
            f"no secret is known for the brick at {host}; "
            f"make one with: drivelesson brick agent {host}, or give --brick-secret"
        ) from None


def _advice(verdict: dict[str, Any], host: str) -> str:
    if "secret" in verdict["refused"]:
        return f"give --brick-secret, or make a new one with: drivelesson brick agent {host}"
    return "stop the other server first"


def _next_message(line: socket.socket, unpacker: Unpacker) -> dict[str, Any]:
    while (found := unpacker.next()) is None:
        data = line.recv(1024)
        if not data:
            raise OSError("it closed the connection")
        unpacker.feed(data)
    message: dict[str, Any] = json.loads(found[1])
    return message
