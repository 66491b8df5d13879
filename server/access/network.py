"""The machine's own addresses and names, and `http://drivelesson.local`: the robot's name on the
local network, by mDNS."""

from __future__ import annotations

import contextlib
import logging
import socket
from collections.abc import Iterator

from robot.errors import MissingExtraError
from server.config import Config, as_address

log = logging.getLogger(__name__)

ROBOT, ADDRESS = "drivelesson", "address"
"""Properties of the service: the robot's name, and the best of its addresses."""


def lan_addresses(config: Config) -> list[str]:
    """Return the IPv4 addresses for the terminal and the certificate, the most likely first."""
    if config.host not in ("0.0.0.0", "::"):
        return [config.host]
    return [address for address in own_addresses() if not address.startswith("127.")]


def own_addresses() -> list[str]:
    """Return this machine's IPv4 addresses; first the one that others most likely see."""
    found: list[str] = []
    with contextlib.suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # the source of packets to other networks; nothing is sent
        found.append(str(probe.getsockname()[0]))
    with contextlib.suppress(ImportError):
        import ifaddr  # comes with zeroconf

        for adapter in ifaddr.get_adapters():
            found += [str(ip.ip) for ip in adapter.ips if ip.is_IPv4]
    return list(dict.fromkeys(found))


def page_addresses(config: Config) -> list[str]:
    """Return the addresses of the page, the best first."""
    public = [str(address) for address in config.public]
    if public and not config.lan:
        return public
    hosts = [*lan_addresses(config), f"{config.hostname}.local"] if config.lan else [config.host]
    if config.tls:  # no certificate of ours is for a public address: the name comes before it
        hosts.sort(key=lambda host: not getattr(as_address(host), "is_private", True))
    scheme = "https" if config.tls else "http"
    own = [f"{scheme}://{f'[{h}]' if ':' in h else h}:{config.port}" for h in hosts]
    return public + own


def host_names(config: Config) -> list[str]:
    own = socket.gethostname().lower()
    names = ["localhost", "127.0.0.1", "::1"]
    if config.lan:
        names += [f"{config.hostname}.local", own, f"{own}.local"]
    return list(dict.fromkeys([*names, config.host.lower()]))


@contextlib.contextmanager
def announced(config: Config, robot: str) -> Iterator[None]:
    """Answer to the robot's name on the network inside the block.

    Robots that share a host name would share their addresses too, so each says its own in a
    property, where the board of a class reads it.

    Where the network allows no multicast, or zeroconf is not installed, that is only logged, and
    the robot drives.
    """
    hostname, addresses = config.hostname, lan_addresses(config)
    try:
        from zeroconf import Error, ServiceInfo, Zeroconf
    except ImportError:
        log.warning("%s", MissingExtraError(f"the name {hostname}.local", "lan"))
        yield
        return
    kind = "_https._tcp.local." if config.tls else "_http._tcp.local."
    with contextlib.ExitStack() as stack:
        try:
            service = ServiceInfo(
                kind,
                f"Drivelesson {hostname}.{kind}",
                port=config.port,
                addresses=[socket.inet_aton(address) for address in addresses],
                server=f"{hostname}.local.",
                properties={"path": "/", ROBOT: robot, ADDRESS: addresses[0] if addresses else ""},
            )
            responder = Zeroconf(interfaces=addresses)
            stack.callback(responder.close)
            responder.register_service(service, allow_name_change=True)
            log.info("mdns name=%s.local port=%d", hostname, config.port)
        except (OSError, Error) as error:
            log.warning("mdns off error=%r", str(error))
        yield
