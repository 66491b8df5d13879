"""The names and addresses of this machine."""

from __future__ import annotations

import contextlib
import socket

from server.config import Config


def lan_addresses(config: Config) -> list[str]:
    """Return the IPv4 addresses for the terminal and the certificate, the most likely first."""
    if config.host not in ("0.0.0.0", "::"):
        return [config.host]
    return [address for address in own_addresses() if not address.startswith("127.")]


def own_addresses() -> list[str]:
    """Return this machine's IPv4 addresses; first the one that others most likely see."""
    found = [_outward_address()]
    with contextlib.suppress(ImportError):
        import ifaddr  # comes with zeroconf

        for adapter in ifaddr.get_adapters():
            found += [str(ip.ip) for ip in adapter.ips if ip.is_IPv4]
    return list(dict.fromkeys(filter(None, found)))


def page_addresses(config: Config) -> list[str]:
    """Return the addresses of the page to show, the best first."""
    public = [str(address) for address in config.public]
    if public and not config.lan:
        return public
    hosts = [*lan_addresses(config), f"{config.hostname}.local"] if config.lan else [config.host]
    scheme = "https" if config.tls else "http"
    own = [f"{scheme}://{f'[{h}]' if ':' in h else h}:{config.port}" for h in hosts]
    return public + own


def host_names(config: Config) -> list[str]:
    """Return the host names of this machine."""
    own = socket.gethostname().lower()
    names = ["localhost", "127.0.0.1", "::1"]
    if config.lan:
        names += [f"{config.hostname}.local", own, f"{own}.local"]
    return list(dict.fromkeys([*names, config.host.lower()]))


def _outward_address() -> str | None:
    """Return the source address of packets to other networks. Nothing is sent."""
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))
        return str(probe.getsockname()[0])
    return None
