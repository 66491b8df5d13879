"""A line to a robot: one message there, one back."""

from __future__ import annotations

from typing import Protocol

from robot.errors import ConfigurationError


class MessageLine(Protocol):
    """Messages as bytes. Methods raise OSError when the line fails."""

    def send(self, message: bytes) -> None:
        """Send one message."""

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next message, or None after `timeout_s`."""

    def close(self) -> None:
        """Let go; idempotent."""


def split_address(address: str, default_port: int) -> tuple[str, int]:
    """Return host and port of HOST or HOST:PORT.

    Raises:
        ConfigurationError: If it is neither.
    """
    host, _, port = address.strip().rpartition(":") if ":" in address else (address.strip(), "", "")
    number = port or str(default_port)
    if not host or "/" in host or not number.isdecimal() or not 0 < int(number) < 65536:
        raise ConfigurationError(
            f"--address must be the robot's HOST or HOST:PORT, not {address!r}"
        )
    return host, int(number)
