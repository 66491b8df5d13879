"""The configuration of a server on a network."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field
from typing import Self
from urllib.parse import urlsplit

from robot.errors import ConfigurationError, told_as
from server.config import Config, Limits, is_loopback

DEFAULT_HOSTNAME = "drivelesson"
Network = ipaddress.IPv4Network | ipaddress.IPv6Network


@dataclass(frozen=True, slots=True)
class PublicAddress:
    """The address at which people open the page when a proxy serves it."""

    scheme: str
    host: str
    """The host name as browsers send it, with the port unless it is the default of the scheme."""
    prefix: str = ""
    """The path under which the proxy serves the page, such as /robot; empty for the root."""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read `https://home.example/robot/`."""
        try:
            parts = urlsplit(text.strip())
            port, name = parts.port, (parts.hostname or "").encode("idna").decode()
        except ValueError:  # the address has an invalid port or host
            port, name, parts = None, "", urlsplit("")
        prefix = parts.path.rstrip("/")
        is_plain = not (parts.query or parts.fragment or parts.username or parts.password)
        if parts.scheme not in ("http", "https") or not name or not is_plain or "//" in prefix:
            raise ConfigurationError(
                f"--behind-proxy {text!r} is not the address of a page, "
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
        """The page's origin, as a browser sends it."""
        return f"{self.scheme}://{self.host}"

    def __str__(self) -> str:
        return self.origin + self.prefix


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkLimits(Limits):
    """The limits of a server that other machines can reach."""

    clients: int = 160
    """Maximum number of open websockets and streams of all clients together."""
    clients_each: int = 8
    """Maximum number of open websockets and streams of one person; one page has two."""
    connections_each: int = 24
    """Maximum number of connections of one person."""
    requests_per_second: float = 50.0
    """Maximum average number of requests per second of one person, or of one address."""
    requests_burst: float = 300.0
    uploads: int = 2
    """Maximum number of simultaneous uploads; each person may have one at a time."""
    pending: int = 384
    """Maximum number of connections that the guard has not admitted yet, over all addresses."""
    pending_per_address: int = 384
    """Maximum number of pending connections of one address (for IPv6, of one /64 network)."""
    pending_s: float = 20.0
    """Time without a complete request after which a pending connection is closed, in seconds. The
    time is long enough for a busy laptop to make the TLS handshakes of a whole class. If a new
    connection needs the slot, a pending connection is closed earlier."""
    pairing_failures: int = 10
    """Number of wrong tokens per minute after which one address has to wait. The right token is
    accepted even during that wait."""

    @classmethod
    def of(cls, limits: Limits) -> Self:
        """Convert `Limits` to `NetworkLimits`; the additional limits get their defaults."""
        if isinstance(limits, cls):
            return limits
        return cls(**{name: getattr(limits, name) for name in Limits.__dataclass_fields__})


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkConfig(Config):
    """The settings of a server for a network. See docs/reference/configuration.md for each
    field."""

    lan: bool = False
    tls: bool = False
    hostname: str = DEFAULT_HOSTNAME
    """The robot's name on the local network, without `.local`."""
    also_at: tuple[str, ...] = ()
    """Further names that this machine has, in lower case."""
    public: tuple[PublicAddress, ...] = ()
    """The addresses at which people open the page if proxies serve it; the first is shown."""
    proxies: tuple[Network, ...] = ()
    """The networks from which the proxies connect."""
    limits: NetworkLimits = field(default_factory=NetworkLimits)

    @classmethod
    def of(cls, config: Config) -> Self:
        """Convert a `Config` to a `NetworkConfig`; the additional settings get their defaults."""
        if isinstance(config, cls):
            return config
        given = {name: getattr(config, name) for name in Config.__dataclass_fields__}
        return cls(**{**given, "limits": NetworkLimits.of(config.limits)})

    def __post_init__(self) -> None:
        if not self.needs_pairing and not is_loopback(self.host):
            raise ConfigurationError(
                f"--host {self.host} can be reached from other machines; add --lan, "
                "which admits paired browsers only, or leave --host out"
            )

    @property
    def needs_pairing(self) -> bool:
        """True if other machines can reach the server, which then admits only paired browsers."""
        return self.lan or bool(self.public)

    @property
    def is_secure(self) -> bool:
        """True if the page can only be reached over https."""
        own = [self.tls] if self.lan or not self.public else []
        return all([*own, *(public.scheme == "https" for public in self.public)])


def read_networks(text: str) -> tuple[Network, ...]:
    """Read a comma-separated list of addresses and networks."""
    with told_as(ConfigurationError, "--proxy-at", ValueError):
        return tuple(ipaddress.ip_network(one.strip(), strict=False) for one in text.split(","))
