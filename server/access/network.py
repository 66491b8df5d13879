"""This machine's own addresses and names, and the addresses at which it serves the page."""

from __future__ import annotations

import contextlib
import re
import socket
from collections.abc import Iterable, Sequence
from pathlib import Path

from server.access.config import NetworkConfig
from server.config import as_address
from server.gateway.gateway import loopback_names

ROBOT, ADDRESS = "drivelesson", "address"
"""Names of two properties of the announced service: the robot's name and its best address."""
EVERYWHERE = ("0.0.0.0", "::")
_RESOLVER = Path("/etc/resolv.conf")
_WHOLE = 32
"""The prefix length of an IPv4 network of a single address."""
_NAME = re.compile(r"[\w-]+(?:\.[\w-]+)*", re.ASCII)
_PROBES = ((socket.AF_INET, "192.0.2.1"), (socket.AF_INET6, "2001:db8::1"))
"""Addresses reserved for documentation. Connecting a UDP socket to a reserved address sends
nothing, but shows which address of this machine the system would use."""


def lan_addresses(config: NetworkConfig) -> list[str]:
    """Return this machine's addresses in its network, the most likely to be reachable first."""
    if config.host not in EVERYWHERE:
        return [config.host]
    found = own_addresses()
    if config.host == "::":
        found += own_addresses(6)
    return [address for address in found if is_for_others(address)]


def is_for_others(address: str) -> bool:
    """True if the page can be opened at this address from another machine."""
    own = as_address(address)
    return own is not None and not own.is_loopback and not (own.version == 6 and own.is_link_local)


def own_addresses(version: int = 4) -> list[str]:
    """Return this machine's IPv4 or IPv6 addresses, the most likely to be reachable first.

    An IPv4 network of a single address is a VPN tunnel, in which there are no phones. Its address
    is last, even if the system uses it for the internet.
    """
    found: list[str] = []
    tunnels = set[str]()
    family, elsewhere = _PROBES[version == 6]
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((elsewhere, 9))
        found.append(str(probe.getsockname()[0]))
    with contextlib.suppress(ImportError):
        import ifaddr  # zeroconf installs this package

        for adapter in ifaddr.get_adapters():
            for ip in adapter.ips:
                if ip.is_IPv4 == (version == 4):
                    found.append(str(ip.ip) if ip.is_IPv4 else ip.ip[0])
                    if ip.is_IPv4 and ip.network_prefix == _WHOLE:
                        tunnels.add(found[-1])
    return sorted(dict.fromkeys(found), key=tunnels.__contains__)


def page_addresses(config: NetworkConfig, addresses: Sequence[str] | None = None) -> list[str]:
    """Return the addresses of the page, the best first; `addresses` are those of this machine."""
    public = [str(address) for address in config.public]
    if public and not config.lan:
        return public
    if config.lan:
        own = lan_addresses(config) if addresses is None else addresses
        hosts = [*own, f"{config.hostname}.local"]
    else:
        hosts = [config.host]
    # List public IP addresses last, because our certificates do not contain them.
    if config.tls:
        hosts.sort(key=lambda host: not getattr(as_address(host), "is_private", True))
    scheme = "https" if config.tls else "http"
    return public + [
        f"{scheme}://{f'[{h}]' if ':' in h else h}:{config.port}" for h in dict.fromkeys(hosts)
    ]


def host_names(config: NetworkConfig) -> list[str]:
    """Return the robot's names that are known without asking the resolver."""
    own = socket.gethostname().lower()
    names = [f"{config.hostname}.local", own, f"{own}.local"] if config.lan else []
    return list(dict.fromkeys([*loopback_names(config), *names, *config.also_at]))


def names_in_network(
    hostname: str, addresses: Iterable[str], resolver: Path = _RESOLVER
) -> list[str]:
    """Return this machine's names in the network; may wait for the resolver for many seconds.

    The names are the host name, the host name with each search domain, and the names that the
    resolver returns for the machine's addresses.
    """
    own = socket.gethostname().lower()
    first = [own.partition(".")[0], hostname.lower()]
    found = [
        own,
        f"{first[0]}.local",
        *(f"{name}.{end}" for end in _domains(resolver) for name in first),
    ]
    if first[0] == "penguin":  # a Chromebook's browser reaches its Linux system by this name
        found.append("penguin.linux.test")
    for address in addresses:
        with contextlib.suppress(OSError):
            name, aliases, _ = socket.gethostbyaddr(address)
            found += [name, *aliases]
    plain = [name.lower().rstrip(".") for name in found]
    return [name for name in dict.fromkeys(plain) if _NAME.fullmatch(name)]


def _domains(resolver: Path) -> list[str]:
    """Return the search domains of a file like /etc/resolv.conf. If several lines contain search
    domains, the last one counts."""
    try:
        lines = resolver.read_text("utf-8", "replace").splitlines()
    except OSError:
        return []
    found: list[str] = []
    for line in lines:
        word, *rest = line.split() or [""]
        if word in ("search", "domain"):
            found = [end.strip(".").lower() for end in rest]
    return [end for end in found if end and end not in ("local", "localhost")]
