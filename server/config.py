"""The server's configuration: one frozen object, validated once."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from pathlib import Path

from robot.errors import ConfigurationError
from robot.store.folder import default_root


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits for one client, and for all clients together."""

    messages_per_second: float = 60.0
    """Messages of one client on `/ws/drive`; a page sends about twelve a second."""
    messages_burst: float = 120.0
    frames_per_second: float = 150.0
    """Acknowledgements of one client on `/ws/video`."""
    refused_before_closing: int = 500
    """A client is disconnected after so many refused messages."""
    clients: int = 160
    """Open websockets and streams of all clients together."""
    clients_each: int = 8
    """The same of one paired browser; the page has two."""
    connections_each: int = 24
    """Connections of one paired browser."""
    requests_per_second: float = 50.0
    """Requests of one paired browser, or of one address, on average."""
    requests_burst: float = 300.0
    body_bytes: int = 1_000_000
    """The largest body of a request that has no limit of its own."""
    upload_bytes: int = 64_000_000
    """The largest model that may be uploaded."""
    idle_s: float = 30.0
    """Idle timeout: a silent client is disconnected."""
    pairing_failures: int = 10
    """Wrong tokens from one address in a minute before it has to wait. The right token is
    accepted even then."""
    pending: int = 384
    """Connections that the guard has not admitted yet, of all addresses together."""
    pending_per_address: int = 384
    """The same of one address; for IPv6, of one /64 network."""
    pending_s: float = 5.0
    """A pending connection is closed so long after its last complete request."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a running server. Field by field in docs/reference/configuration.md."""

    host: str = "127.0.0.1"
    port: int = 8000
    lan: bool = False
    tls: bool = False
    hostname: str = "drivelesson"
    """The robot's name on the local network, without `.local`."""
    data: Path = field(default_factory=default_root)
    web: Path | None = None
    jpeg_quality: int = 75
    lease_lapse_s: float = 1.5
    proxies: tuple[str, ...] = ()
    """Addresses of proxies whose X-Forwarded-For and X-Forwarded-Proto are believed."""
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65535:
            raise ConfigurationError(f"--port must be between 0 and 65535, not {self.port}")
        if not 1 <= self.jpeg_quality <= 100:
            raise ConfigurationError(
                f"--jpeg-quality must be between 1 and 100, not {self.jpeg_quality}"
            )
        if not self.lan and not is_loopback(self.host):
            raise ConfigurationError(
                f"--host {self.host} can be reached from other machines; add --lan, "
                "which admits paired browsers only, or leave --host out"
            )

    @property
    def web_folder(self) -> Path:
        """The folder of the page's files: beside the package in a clone, inside it in a wheel."""
        return self.web if self.web is not None else _find_web()


def is_loopback(host: str) -> bool:
    """True if only this machine can reach `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _find_web() -> Path:
    here = Path(__file__).resolve().parent
    for folder in (here.parent / "web", here / "web"):
        if (folder / "index.html").is_file():
            return folder
    raise ConfigurationError(
        f"the page's files are missing beside {here}; install drivelesson again"
    )
