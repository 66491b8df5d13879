"""`http://drivelesson.local`: the robot's name on the local network, by mDNS."""

from __future__ import annotations

import contextlib
import logging
import socket
from collections.abc import Iterator, Sequence

from robot.errors import MissingExtraError

log = logging.getLogger(__name__)

ROBOT, ADDRESS = "drivelesson", "address"
"""Properties of the service: the robot's name, and the best of its addresses."""


@contextlib.contextmanager
def announced(
    hostname: str, port: int, addresses: Sequence[str], robot: str, *, tls: bool
) -> Iterator[None]:
    """Answer to `hostname`.local inside the block.

    Robots that share a host name would share their addresses too, so each says its own in a
    property, where the board of a class reads it.

    Where the network allows no multicast, or zeroconf is not installed, that is only logged, and
    the robot drives.
    """
    try:
        from zeroconf import Error, ServiceInfo, Zeroconf
    except ImportError:
        log.warning("%s", MissingExtraError(f"the name {hostname}.local", "lan"))
        yield
        return
    kind = "_https._tcp.local." if tls else "_http._tcp.local."
    service = ServiceInfo(
        kind,
        f"Drivelesson {hostname}.{kind}",
        port=port,
        addresses=[socket.inet_aton(address) for address in addresses],
        server=f"{hostname}.local.",
        properties={"path": "/", ROBOT: robot, ADDRESS: addresses[0] if addresses else ""},
    )
    with contextlib.ExitStack() as stack:
        try:
            responder = Zeroconf(interfaces=list(addresses))
            stack.callback(responder.close)
            responder.register_service(service, allow_name_change=True)
            log.info("mdns name=%s.local port=%d", hostname, port)
        except (OSError, Error) as error:
            log.warning("mdns off error=%r", str(error))
        yield
