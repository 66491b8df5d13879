"""The server's configuration: one frozen object, validated once."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from pathlib import Path

from robot.errors import ConfigurationError
from robot.store.folder import default_root

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits of what one client may send."""

    messages_per_second: float = 60.0
    """Maximum messages per second of one client on `/ws/drive`; the page sends about twelve."""
    messages_burst: float = 120.0
    frames_per_second: float = 150.0
    """Maximum acknowledgements per second of one client on `/ws/video`."""
    refused_before_closing: int = 500
    """Number of refused messages (late ones excepted) after which a client is disconnected."""
    body_bytes: int = 1_000_000
    """Maximum size of a request's body in bytes, unless the path has another limit."""
    upload_bytes: int = 64_000_000
    """Maximum size of an uploaded model in bytes."""
    idle_s: float = 30.0
    """Time without a message after which a client is disconnected, in seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a running server; docs/reference/configuration.md explains each field."""

    host: str = "127.0.0.1"
    port: int = 8000
    data: Path = field(default_factory=default_root)
    web: Path = field(default_factory=lambda: _find_web())
    """The folder of the page's files; next to the package in a clone, inside it in a wheel."""
    jpeg_quality: int = 75
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not is_loopback(self.host):
            raise ConfigurationError(
                f"--host {self.host} opens the robot to other computers and needs the extension "
                "'access', which is not installed; remove --host to serve this computer only"
            )


def is_loopback(host: str) -> bool:
    """True if only this machine can reach `host`."""
    address = as_address("127.0.0.1" if host == "localhost" else host)
    return address is not None and address.is_loopback


def as_address(text: str) -> Address | None:
    """Return an IP address (IPv4-mapped IPv6 as IPv4); None if the text is not an address."""
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def _find_web() -> Path:
    here = Path(__file__).resolve().parent
    for folder in (here.parent / "web", here / "web"):
        if (folder / "index.html").is_file():
            return folder
    raise ConfigurationError(
        f"the page's files were not found next to {here}; reinstall drivelesson"
    )
