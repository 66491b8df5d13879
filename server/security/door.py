"""The door before the door: which connections may stay, long before one has said who it is. Pure.

Whoever can reach the port can open connections, and each costs a descriptor. So a connection that
was not yet admitted is a *stranger*: it has little time, and there is room for few of them, per
address and in all. When there is no room the oldest stranger goes, of the address that has most,
so a flood pushes out itself and a newcomer always has a moment to show its cookie. Connections
that the guard has admitted are never pushed out: what is left of the descriptors is theirs.
"""

from __future__ import annotations

import ipaddress
from collections import Counter, OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from server.config import Limits

Peer = tuple[str, int]
"""Address and port of the other side, as the socket says."""


def address_key(address: str) -> str:
    """Return what counts as one address: of IPv6 the network of 64 bits, which one host may own."""
    try:
        ip = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(ip, ipaddress.IPv6Address):
        if ip.ipv4_mapped is not None:
            return str(ip.ipv4_mapped)
        return str(ipaddress.IPv6Network((ip, 64), strict=False))
    return str(ip)


@dataclass(slots=True)
class _Stranger:
    address: str
    deadline_s: float
    close: Callable[[], None]


class Door:
    """Counts connections, and closes those of strangers that are too many or too slow.

    Args:
        limits: How many and how long.
        capacity: Connections in all; the process's descriptors allow no more.
    """

    def __init__(self, limits: Limits, capacity: int) -> None:
        self._limits = limits
        self._capacity = max(1, capacity)
        self._strangers: OrderedDict[Hashable, _Stranger] = OrderedDict()
        self._admitted: set[Hashable] = set()
        self._of_address: Counter[str] = Counter()
        self.pushed_out = 0

    @property
    def open(self) -> int:
        """How many connections are open."""
        return len(self._strangers) + len(self._admitted)

    def arrive(self, peer: Peer, now_s: float, close: Callable[[], None]) -> bool:
        """Let a new connection in; False if there is no room for it at all.

        Args:
            peer: Its address and port.
            now_s: The time.
            close: Ends the connection; `left` need not have been called before it returns.
        """
        self.expire(now_s)
        address = address_key(peer[0])
        if self._of_address[address] >= self._limits.strangers_per_address:
            self._push_out(address)
        elif len(self._strangers) >= self._limits.strangers:
            self._push_out(self._of_address.most_common(1)[0][0])
        while self.open >= self._capacity:
            if not self._strangers:
                return False
            self._push_out(self._of_address.most_common(1)[0][0])
        self._strangers[peer] = _Stranger(address, now_s + self._limits.stranger_s, close)
        self._of_address[address] += 1
        return True

    def asked(self, peer: Peer, now_s: float) -> None:
        """Take note of a whole request: a stranger gets its time anew."""
        stranger = self._strangers.get(peer)
        if stranger is not None:
            stranger.deadline_s = now_s + self._limits.stranger_s

    def admit(self, peer: Peer) -> None:
        """The guard knows who this is: it is no stranger any more."""
        if self._forget(peer) is not None:
            self._admitted.add(peer)

    def left(self, peer: Peer) -> None:
        """A connection has ended."""
        self._forget(peer)
        self._admitted.discard(peer)

    def expire(self, now_s: float) -> None:
        """Close strangers whose time is up."""
        for peer, stranger in list(self._strangers.items()):
            if now_s >= stranger.deadline_s:
                self._end(peer)

    def _push_out(self, address: str) -> None:
        """Close the oldest stranger of an address."""
        for peer, stranger in self._strangers.items():
            if stranger.address == address:
                self._end(peer)
                return

    def _end(self, peer: Hashable) -> None:
        stranger = self._forget(peer)
        if stranger is not None:
            self.pushed_out += 1
            stranger.close()

    def _forget(self, peer: Hashable) -> _Stranger | None:
        stranger = self._strangers.pop(peer, None)
        if stranger is not None:
            self._of_address[stranger.address] -= 1
            if not self._of_address[stranger.address]:
                del self._of_address[stranger.address]
        return stranger
