"""Limits on connections that are not admitted yet. Pure.

Anyone who can reach the port can open connections, and each costs a file descriptor. So a
connection is *pending* until the guard admits it: it has little time, and few of them may be open,
per address and in all. When the limit is reached, the oldest pending connection of the address
that has most is closed. A flood so evicts itself, and a new client always has a moment to send its
cookie. Connections that the guard has admitted are never evicted.
"""

from __future__ import annotations

import ipaddress
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from server.config import Limits

Peer = tuple[str, int]
"""Address and port of the remote side, as the socket reports them."""


@lru_cache(maxsize=1024)
def address_key(address: str) -> str:
    """Return what counts as one address: for IPv6 the /64 network, which one host may own."""
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
class _Pending:
    address: str
    deadline_s: float
    close: Callable[[], None]


class Newest:
    """The newest connections of each address, in the order in which they came.

    Args:
        per_address: So many of one address.
        in_all: So many of all; beyond it the address that has most loses its oldest.
    """

    def __init__(self, per_address: int, in_all: int) -> None:
        self._per_address, self._in_all = per_address, in_all
        self._of_address: dict[str, deque[int]] = {}
        self._kept: dict[int, Any] = {}
        self._count = 0

    def add(self, address: str, connection: Any) -> list[Any]:
        """Add one that has just come; return those that have to go for it."""
        self._count += 1
        own = self._of_address.setdefault(address, deque())
        own.append(self._count)
        self._kept[self._count] = connection
        if len(own) > self._per_address:
            return [self._kept.pop(own.popleft())]
        if len(self._kept) > self._in_all:
            most = max(self._of_address.values(), key=len)
            return [self._kept.pop(most.popleft())]
        return []

    def __iter__(self) -> Iterator[Any]:
        return iter(self._kept.values())


class Door:
    """Counts connections, and closes pending ones that are too many or too slow.

    Args:
        limits: How many pending connections, and for how long.
        capacity: Connections in all, as the process's file descriptors allow.
    """

    def __init__(self, limits: Limits, capacity: int) -> None:
        self.limits = limits
        self._capacity = max(1, capacity)
        self._pending: OrderedDict[Hashable, _Pending] = OrderedDict()
        self._admitted: set[Hashable] = set()
        self._of_address: Counter[str] = Counter()
        self.evicted = 0

    @property
    def open(self) -> int:
        """How many connections are open."""
        return len(self._pending) + len(self._admitted)

    def arrive(self, peer: Peer, now_s: float, close: Callable[[], None]) -> bool:
        """Add a new connection as pending; False if there is no room for it.

        Args:
            peer: Its address and port.
            now_s: The time.
            close: Ends the connection; `left` need not have been called before it returns.
        """
        self.expire(now_s)
        address = address_key(peer[0])
        if self._of_address[address] >= self.limits.pending_per_address:
            self._evict(address)
        elif len(self._pending) >= self.limits.pending:
            self._evict(self._of_address.most_common(1)[0][0])
        while self.open >= self._capacity:
            if not self._pending:
                return False
            self._evict(self._of_address.most_common(1)[0][0])
        self._pending[peer] = _Pending(address, now_s + self.limits.pending_s, close)
        self._of_address[address] += 1
        return True

    def asked(self, peer: Peer, now_s: float) -> None:
        """Record a complete request: the timeout of a pending connection starts again."""
        connection = self._pending.get(peer)
        if connection is not None:
            connection.deadline_s = now_s + self.limits.pending_s

    def admit(self, peer: Peer) -> None:
        """Mark a connection as admitted by the guard; it is no longer pending."""
        if self._forget(peer) is not None:
            self._admitted.add(peer)

    def left(self, peer: Peer) -> None:
        """Remove a closed connection."""
        self._forget(peer)
        self._admitted.discard(peer)

    def expire(self, now_s: float) -> None:
        """Close pending connections that have timed out."""
        for peer, connection in list(self._pending.items()):
            if now_s >= connection.deadline_s:
                self._end(peer)

    def _evict(self, address: str) -> None:
        """Close the oldest pending connection of an address."""
        for peer, connection in self._pending.items():
            if connection.address == address:
                self._end(peer)
                return

    def _end(self, peer: Hashable) -> None:
        connection = self._forget(peer)
        if connection is not None:
            self.evicted += 1
            connection.close()

    def _forget(self, peer: Hashable) -> _Pending | None:
        connection = self._pending.pop(peer, None)
        if connection is not None:
            self._of_address[connection.address] -= 1
            if not self._of_address[connection.address]:
                del self._of_address[connection.address]
        return connection
