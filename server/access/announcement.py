"""`http://drivelesson.local`: the robot's name on the local network, by mDNS."""

from __future__ import annotations

import contextlib
import importlib
import ipaddress
import logging
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from robot.errors import MissingExtraError
from server.access.config import DEFAULT_HOSTNAME, NetworkConfig
from server.access.network import ADDRESS, ROBOT, lan_addresses
from server.config import Address, as_address

log = logging.getLogger(__name__)
PROBE_MS = 700
"""How long the robot asks the network whether another machine uses a name, in ms (RFC 6762)."""
_HEARD_MS = 15_000.0
"""Age in milliseconds above which another robot's mDNS answer is ignored, because that robot may be
gone. A robot asks every 10 s, so any other robot in the network has answered within this time."""
_A, _AAAA = 1, 28
_MOST_NAMES = 50


class Announcement:
    """Announces the robot's name on the network by mDNS.

    Two robots may have the same host name, which then resolves to the addresses of both. So each
    robot also publishes its best address in a property. The board of a class reads the property.

    If the network allows no multicast, or zeroconf is not installed, a warning is logged and the
    robot drives without an announced name.
    """

    def __init__(self, config: NetworkConfig, robot: str) -> None:
        self._config, self._robot = config, robot
        self._responder: Any = None
        self._is_off = False
        self.hostname = config.hostname
        self._next = 2
        """The first number to try if the robot needs a name such as NAME-2."""

    def announce(self, addresses: Sequence[str]) -> str:
        """Announce the robot at these addresses; return the name that it got, without `.local`.

        If another machine already has the default name, this robot takes the default name with a
        number, such as NAME-2.
        """
        self.close()
        try:
            import zeroconf
        except ImportError:
            if not self._is_off:
                extra = MissingExtraError(f"the name {self.hostname}.local", "lan")
                log.warning("%s", extra)
            self._is_off = True
            return self.hostname
        _be_brief(logging.getLogger("zeroconf"))
        addresses = [one for one in addresses if as_address(one) is not None]
        if not addresses:  # `Surroundings` calls this method again once there is an address
            log.warning("mdns off: this machine has no address in a network")
            return self.hostname
        try:
            version = (
                zeroconf.IPVersion.All if any(map(_is_6, addresses)) else zeroconf.IPVersion.V4Only
            )
            self._responder = zeroconf.Zeroconf(interfaces=list(addresses), ip_version=version)
            self.hostname = self._free_name(addresses)
            self._responder.register_service(self._service(addresses), allow_name_change=True)
            log.info("mdns name=%s.local port=%d", self.hostname, self._config.port)
        except (OSError, ValueError, zeroconf.Error, RuntimeError) as error:
            log.warning("mdns off error=%r", str(error))
            self.close()
        return self.hostname

    def _service(self, addresses: Sequence[str]) -> Any:
        from zeroconf import ServiceInfo

        kind = "_https._tcp.local." if self._config.tls else "_http._tcp.local."
        best = addresses[0] if addresses else ""
        return ServiceInfo(
            kind,
            f"Drivelesson {self.hostname}.{kind}",
            port=self._config.port,
            parsed_addresses=list(addresses),
            server=f"{self.hostname}.local.",
            properties={"path": "/", ROBOT: self._robot, ADDRESS: best},
        )

    def _free_name(self, addresses: Sequence[str]) -> str:
        """Return the wanted name; if another machine has it, the name with the next free number."""
        first = self._config.hostname
        others = self.others_at(self.hostname, addresses)
        if not others:
            return self.hostname
        if first != DEFAULT_HOSTNAME:  # a name that the user chose is never changed
            log.warning("%s.local is taken by %s: choose another --hostname", first, min(others))
            return first
        for number in range(self._next, self._next + _MOST_NAMES):
            if not self.others_at(f"{first}-{number}", addresses):
                return f"{first}-{number}"
        return first

    def others_at(self, name: str, addresses: Sequence[str]) -> set[str]:
        """Return the addresses of other machines that answer to a name."""
        import zeroconf

        if not hasattr(zeroconf, "AddressResolver"):  # zeroconf has this class since 0.133
            return set()
        asked = zeroconf.AddressResolver(f"{name}.local.")
        asked.request(self._responder, PROBE_MS)
        own = {str(as_address(address)) for address in addresses}
        return {one.partition("%")[0] for one in asked.parsed_addresses()} - own

    def must_yield(self, addresses: Sequence[str]) -> bool:
        """True if another robot has this name too and this robot has to take a new name.

        Of several robots with the same name, the one with the lowest address keeps it. A name that
        a person chose is never changed.
        """
        if self._responder is None or self._config.hostname != DEFAULT_HOSTNAME:
            return False
        zeroconf: Any = importlib.import_module("zeroconf")
        name = f"{self.hostname}.local."
        heard_ms = zeroconf.current_time_millis() - _HEARD_MS
        own = {one for one in map(as_address, addresses) if one is not None}
        others: set[Address] = {
            ipaddress.ip_address(record.address)
            for record in self._responder.cache.entries_with_name(name)
            if isinstance(record, zeroconf.DNSAddress) and record.created > heard_ms
        } - own
        question = zeroconf.DNSOutgoing(0)
        for kind in (_A, _AAAA):
            question.add_question(zeroconf.DNSQuestion(name, kind, 1))
        with contextlib.suppress(OSError):
            self._responder.send(question)  # the next call reads the answers
        before = [other for other in others if own and _lowest([other]) < _lowest(own)]
        # so that robots that give way at the same time choose different numbers
        self._next = max(2, 1 + len(before))
        return bool(before)

    def close(self) -> None:
        """Withdraw the announcement; idempotent."""
        responder, self._responder = self._responder, None
        if responder is not None:
            with contextlib.suppress(Exception):  # closing fails if the network is gone
                responder.close()


@contextlib.contextmanager
def announced(config: NetworkConfig, robot: str) -> Iterator[None]:
    """While the `with` block runs, announce the robot's name on the network."""
    announcement = Announcement(config, robot)
    announcement.announce(lan_addresses(config))
    try:
        yield
    finally:
        announcement.close()


def _lowest(addresses: Iterable[Address]) -> tuple[int, bytes]:
    return min((address.version, address.packed) for address in addresses)


def _is_6(address: str) -> bool:
    return ":" in address


def _one_line(record: logging.LogRecord) -> bool:
    """Remove the traceback from a log record of zeroconf.

    Zeroconf logs an error whenever an address is gone. The error is harmless, because `Watch` then
    announces the robot again.
    """
    record.exc_info = None
    return True


def _be_brief(logger: logging.Logger) -> None:
    if _one_line not in logger.filters:
        logger.addFilter(_one_line)
