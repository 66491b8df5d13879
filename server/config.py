"""The server's configuration: one frozen object, validated once."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

from robot.errors import ConfigurationError, told_as
from robot.store.folder import default_root

DEFAULT_HOSTNAME = "drivelesson"
Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True, slots=True)
class PublicAddress:
    """The address at which people open the page where a proxy serves it."""

    scheme: str
    host: str
    """Name, and the port if it is not the scheme's own: as browsers send it."""
    prefix: str = ""
    """The path, such as /robot; nothing for the root."""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read `https://home.example/robot/`."""
        try:
            parts = urlsplit(text.strip())
            port, name = parts.port, (parts.hostname or "").encode("idna").decode()
        except ValueError:  # a port or a name that is none
            port, name, parts = None, "", urlsplit("")
        prefix = parts.path.rstrip("/")
        is_plain = not (parts.query or parts.fragment or parts.username or parts.password)
        if parts.scheme not in ("http", "https") or not name or not is_plain or "//" in prefix:
            raise ConfigurationError(
                f"--behind-proxy {text!r} is not an address that people open, "
                "such as https://home.example/robot/"
            )
        host = f"[{name}]" if ":" in name else name
        if port not in (None, {"http": 80, "https": 443}[parts.scheme]):
            host = f"{host}:{port}"
        return cls(parts.scheme, host, prefix)

    @property
    def name(self) -> str:
        return urlsplit(f"//{self.host}").hostname or ""

    @property
    def origin(self) -> str:
        """What a browser calls the page's origin."""
        return f"{self.scheme}://{self.host}"

    def __str__(self) -> str:
        return self.origin + self.prefix


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits for one client, and for all clients together."""

    messages_per_second: float = 60.0
    """Messages of one client on `/ws/drive`; a page sends about twelve a second."""
    messages_burst: float = 120.0
    frames_per_second: float = 150.0
    """Acknowledgements of one client on `/ws/video`."""
    refused_before_closing: int = 500
    """A client is disconnected after so many refused messages, but for those that came late."""
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
    uploads: int = 2
    """So many are uploaded at a time, and one by each paired browser."""
    idle_s: float = 30.0
    """Idle timeout: a silent client is disconnected."""
    pairing_failures: int = 10
    """Wrong tokens from one address in a minute before it has to wait. The right token is
    accepted even then."""
    pending: int = 384
    """Connections that the guard has not admitted yet, of all addresses together."""
    pending_per_address: int = 384
    """The same of one address; for IPv6, of one /64 network."""
    pending_s: float = 20.0
    """A pending connection is closed so long after its last complete request. Long enough for a
    class that shakes hands over TLS with a busy laptop: who needs a place takes one at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """The settings of a running server. Field by field in docs/reference/configuration.md."""

    host: str = "127.0.0.1"
    port: int = 8000
    lan: bool = False
    tls: bool = False
    hostname: str = DEFAULT_HOSTNAME
    """The robot's name on the local network, without `.local`."""
    also_at: tuple[str, ...] = ()
    """Further names that this machine has, in lower case."""
    data: Path = field(default_factory=default_root)
    web: Path = field(default_factory=lambda: _find_web())
    """The page's files: beside the package in a clone, inside it in a wheel."""
    jpeg_quality: int = 75
    public: tuple[PublicAddress, ...] = ()
    """Where people open the page, if proxies serve it; the first is shown."""
    proxies: tuple[Network, ...] = ()
    """Where connections of these proxies come from."""
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if not self.needs_pairing and not is_loopback(self.host):
            raise ConfigurationError(
                f"--host {self.host} can be reached from other machines; add --lan, "
                "which admits paired browsers only, or leave --host out"
            )

    @property
    def needs_pairing(self) -> bool:
        """True if people on other machines can reach the server: then it admits paired browsers."""
        return self.lan or bool(self.public)

    @property
    def is_secure(self) -> bool:
        """True if every way to the page is https."""
        own = [self.tls] if self.lan or not self.public else []
        return all([*own, *(public.scheme == "https" for public in self.public)])


def is_loopback(host: str) -> bool:
    """True if only this machine can reach `host`."""
    address = as_address("127.0.0.1" if host == "localhost" else host)
    return address is not None and address.is_loopback


def as_address(text: str) -> Address | None:
    """Return an IP address, of IPv4 as such; None if the text is none."""
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def read_networks(text: str) -> tuple[Network, ...]:
    """Read addresses and networks, with commas in between."""
    with told_as(ConfigurationError, "--proxy-at", ValueError):
        return tuple(ipaddress.ip_network(one.strip(), strict=False) for one in text.split(","))


def _find_web() -> Path:
    here = Path(__file__).resolve().parent
    for folder in (here.parent / "web", here / "web"):
        if (folder / "index.html").is_file():
            return folder
    raise ConfigurationError(
        f"the page's files are missing beside {here}; install drivelesson again"
    )
