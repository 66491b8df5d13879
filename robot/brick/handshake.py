"""Joining the agent on a brick: connect, prove that one knows the secret, be let in or refused."""

from __future__ import annotations

import json
import os
import socket
from pathlib import Path
from typing import Any

from robot.brick.agent.ports import HardwareError
from robot.brick.agent.wire import PORT, PROTOCOL, Unpacker, pack_json, prove
from robot.errors import ConfigurationError

PATIENCE_S = 3.0
"""How long joining, or opening the body, may take."""


def join(address: str, secret: str = "") -> tuple[socket.socket, Unpacker]:
    """Join the agent at `host` or `host:port`; with the kept secret unless one is given.

    Returns:
        The connection, and what unpacks the messages that come on it.

    Raises:
        ConfigurationError: If the address is none.
        HardwareError: If nobody answers, or the agent refuses.
    """
    host, _, port = address.partition(":")
    try:
        line = socket.create_connection((host, int(port or PORT)), timeout=PATIENCE_S)
    except ValueError:
        raise ConfigurationError(f"--brick {address} is no address:port") from None
    except OSError as error:
        raise HardwareError(
            f"no agent answers at {host} port {port or PORT} ({error.strerror or error}); "
            f"start it with: drivelesson brick agent {host}"
        ) from error
    unpacker = Unpacker()
    try:
        _shake_hands(line, unpacker, host, secret or kept_secret(host))
    except (OSError, ValueError, KeyError) as error:
        line.close()
        raise HardwareError(
            f"what answers at {host} port {port or PORT} is no agent of this version "
            f"({error}); renew it with: drivelesson brick agent {host}"
        ) from error
    except HardwareError:
        line.close()
        raise
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line, unpacker


def _shake_hands(line: socket.socket, unpacker: Unpacker, host: str, secret: str) -> None:
    hello = _next_message(line, unpacker)
    if hello["hello"] != PROTOCOL:
        raise ValueError(f"it speaks version {hello['hello']}")
    line.sendall(pack_json({"do": "join", "proof": prove(secret, hello["nonce"])}))
    verdict = _next_message(line, unpacker)
    if "refused" in verdict:
        raise HardwareError(
            f"the brick at {host} refuses: {verdict['refused']}; " + _advice(verdict, host)
        )


def secret_path(host: str) -> Path:
    """Where `drivelesson brick agent` keeps the secret that it shares with a brick."""
    home = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    return Path(home) / "drivelesson" / f"brick-{host}.secret"


def kept_secret(host: str) -> str:
    """Read the kept secret of a brick.

    Raises:
        HardwareError: If there is none.
    """
    given = os.environ.get("DRIVELESSON_BRICK_SECRET")
    if given:
        return given
    try:
        return secret_path(host).read_text().strip()
    except OSError:
        raise HardwareError(
            f"no secret is known for the brick at {host}; "
            f"make one with: drivelesson brick agent {host}, or give --brick-secret"
        ) from None


def _advice(verdict: dict[str, Any], host: str) -> str:
    if "secret" in verdict["refused"]:
        return f"give --brick-secret, or make a new one with: drivelesson brick agent {host}"
    return "stop the other server first"


def _next_message(line: socket.socket, unpacker: Unpacker) -> dict[str, Any]:
    while True:
        data = line.recv(4096)
        if not data:
            raise OSError("it hung up")
        for _kind, body in unpacker.feed(data):
            message: dict[str, Any] = json.loads(body)
            return message
