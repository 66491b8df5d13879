"""Joins the agent on a brick: both sides prove that they know the secret, then seal messages."""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from robot.bodies.ev3.agent.wire import (
    BEFORE_JOINING,
    FROM_AGENT,
    PORT,
    PROTOCOL,
    Seal,
    Unpacker,
    is_proof,
    pack_json,
    prove,
)
from robot.bodies.remote.orders import split_address
from robot.errors import DriveError, told_as

PATIENCE_S = 3.0
"""Time limit for joining an agent, and for its opening of motors and sensors, in seconds."""


class BrickConnection:
    """One sealed connection to an agent that has proved its identity.

    Raises:
        DriveError: If the agent refuses, or does not know the secret.
        ValueError: If a message was changed on the way or is from somebody else.
    """

    def __init__(self, line: socket.socket, host: str, secret: str) -> None:
        self.line = line
        self._unpacker = Unpacker(BEFORE_JOINING)
        self._seal: Seal | None = None
        hello = self._next_message()
        if hello["hello"] != PROTOCOL:
            raise ValueError(
                f"the brick has protocol version {hello['hello']}, but this program has {PROTOCOL}"
            )
        theirs, ours = str(hello["nonce"]), secrets.token_hex(16)
        proof = prove(secret, "controller", theirs, ours)
        self.send({"do": "join", "nonce": ours, "proof": proof})
        verdict = self._next_message()
        if "refused" in verdict:
            advice = "stop the other server first"
            if "secret" in verdict["refused"]:
                advice = f"give --brick-secret, or make a new secret with: {_renew(host)}"
            raise DriveError(f"{host} refuses the connection: {verdict['refused']}; {advice}")
        if not is_proof(verdict["proof"], secret, "agent", theirs, ours):
            raise DriveError(
                f"{host} could not prove that it knows the shared secret, so it is not your brick; "
                "check the address, and whether another device uses it"
            )
        self._unpacker.expect_seal(Seal(secret, "agent", theirs, ours), FROM_AGENT)
        self._seal = Seal(secret, "controller", theirs, ours)

    def send(self, message: dict[str, Any]) -> None:
        """Seal a message and send it; one thread at a time."""
        self.line.sendall(pack_json(message, self._seal))

    def receive(self) -> Iterator[tuple[bytes, bytes]]:
        """Wait for data, up to the socket's timeout; yield each message that has arrived
        completely."""
        data = self.line.recv(65536)
        if not data:
            raise OSError("the brick closed the connection")
        yield from self._unpacker.take(data)

    def _next_message(self) -> dict[str, Any]:
        while True:
            for _, body in self.receive():
                message: dict[str, Any] = json.loads(body)
                return message


def dial(address: tuple[str, int]) -> socket.socket:
    """Open a connection to a host and port; reads time out after `PATIENCE_S`."""
    return socket.create_connection(address, timeout=PATIENCE_S)


def join(
    address: str, secret: str = "", dial: Callable[[tuple[str, int]], socket.socket] = dial
) -> BrickConnection:
    """Join the agent at `host` or `host:port`, with `secret` or else the saved secret.

    Raises:
        ConfigurationError: If the address is not valid.
        DriveError: If nobody answers, or the agent refuses or does not know the secret.
    """
    host, port = split_address(address, PORT, "--brick")
    do = f"start it with: {_renew(host)}"
    with told_as(DriveError, f"no agent answers at {host} port {port}", do=do):
        line = dial((host, port))
    try:
        connection = BrickConnection(line, host, secret or kept_secret(host))
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection
    except DriveError:
        line.close()
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        line.close()
        raise DriveError(
            f"the program at {host} port {port} is not an agent of this version "
            f"({error}); install this version with: {_renew(host)}"
        ) from error


def _renew(host: str) -> str:
    return f"drivelesson brick agent {host}"


def secret_path(host: str) -> Path:
    """Return the path at which `drivelesson brick agent` saves the secret shared with a brick."""
    home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(home) / "drivelesson" / f"brick-{host}.secret"


def kept_secret(host: str) -> str:
    """Read the saved secret of a brick; raises DriveError if there is none."""
    given = os.environ.get("DRIVELESSON_BRICK_SECRET")
    if given:
        return given
    try:
        return secret_path(host).read_text().strip()
    except OSError:
        raise DriveError(
            f"no secret is known for the brick at {host}; "
            f"give --brick-secret, or make a secret with: {_renew(host)}"
        ) from None
