"""Admission control: how many connections, sockets and requests each person may use.

Clients are counted per session, or per address if they have none. A connection is *pending* until
the guard has read a request that has a session. Pending connections have slots of their own and
time out soon. So even if all other slots are taken, a new connection is accepted and read, because
it may be a STOP. If the pending slots are full too, the new connection evicts an idle connection.
If none of these is idle, it evicts one that has sent nothing, or else one with an old request.

When no slot is free, the person with the most connections loses one: an idle connection, or the
least recently used. So a person who opens too many connections loses their own. A connection of the
owner, the pilot or the teacher is evicted only for a connection of one of these three. No answer is
broken off to make room for another request. If all connections are busy, a new request is answered
in its pending slot. Nothing here reads a clock: the time is an argument.
"""

from __future__ import annotations

import ipaddress
import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial

from server.access.config import NetworkLimits
from server.access.rate_limits import RateLimits
from server.config import as_address
from server.gateway.roles import Role, Session

log = logging.getLogger(__name__)
Close = Callable[[], object]
Peer = tuple[str, int]
"""Address and port of the remote side, as the socket reports them."""
_READ_S = 0.25
"""Time within which the first request of a new connection is read, even under load, in seconds."""
_ANSWER_S = 2.0
"""How long a connection keeps its pending slot while its request is answered, in seconds, if no
other slot is free."""
_LOG_S = 60.0
"""Minimum time between log lines about one person who exceeds the rate limit, in seconds."""
_SELDOM_S = 1.0
"""Time between two calls of `expire` above which the computer counts as busy, in seconds."""


@lru_cache(maxsize=1024)
def address_key(address: str) -> str:
    """Return the key under which the connections from an address are counted.

    For IPv6, the key is the address's /64 network, because one host may own all of its addresses.
    """
    ip = as_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address):
        return str(ipaddress.IPv6Network((ip, 64), strict=False))
    return address if ip is None else str(ip)


@dataclass(slots=True, eq=False)
class Slot:
    """A slot that a connection or a websocket uses."""

    person: str
    used_s: float
    close: Close
    came_s: float = 0.0
    idle_s: float = math.inf
    """The clock's time at which the connection became idle, in seconds; infinite if it is busy."""
    is_taken: bool = True
    is_known: bool = False
    """True if the session of a pending connection is known. A connection with a known session can
    be evicted, but does not time out."""

    def gives_way(self, before_s: float) -> bool:
        """True if the connection is idle, or sent its request at `before_s` or earlier."""
        return self.idle_s < math.inf or self.used_s <= before_s

    def rank(self) -> tuple[float, ...]:
        """Return the sort key of evictions: idle connections first, websockets last."""
        return self.idle_s, self.used_s == math.inf, self.came_s, self.used_s


class ConnectionLimiter:
    """Limits connections of one kind, in total and per person.

    Args:
        in_all: The total number of slots.
        each: The number of slots that one person may have; a crowd (`Session.is_crowd`) may have
            all.
        is_protected: Returns True for persons who lose slots only to other protected persons.
    """

    def __init__(self, in_all: int, each: int, is_protected: Callable[[str], bool]) -> None:
        self._in_all, self._each = max(1, in_all), max(1, each)
        self._is_protected = is_protected
        self._of: dict[str, list[Slot]] = {}
        self.taken = self.evicted = 0

    def take(
        self, session: Session, now_s: float, close: Close, answer_s: float = 0.0
    ) -> Slot | None:
        """Take a slot, if necessary by evicting another connection; None if none can be evicted.

        `close` is called when this slot is evicted. A connection whose request was read less than
        `answer_s` ago is not evicted.
        """
        before_s = now_s - answer_s if answer_s else math.inf
        if self.is_at_limit(session):
            own = self._of[session.name]
            if not any(one.gives_way(before_s) for one in own):
                return None
            self._evict(own)
        elif self.is_full:
            giving = self._giving(session.name, before_s)
            if not giving:
                return None
            self._evict(giving)
        place = Slot(session.name, now_s, close)
        self._of.setdefault(session.name, []).append(place)
        self.taken += 1
        return place

    def give_back(self, place: Slot) -> None:
        """Free a slot; idempotent."""
        own = self._of.get(place.person, [])
        if place in own:
            own.remove(place)
            place.is_taken = False
            self.taken -= 1
            if not own:
                del self._of[place.person]

    def is_at_limit(self, session: Session) -> bool:
        """True if a person's next connection must evict one of that person's connections."""
        return not session.is_crowd and len(self._of.get(session.name, ())) >= self._each

    @property
    def is_full(self) -> bool:
        """True if no slot is free: the next connection must evict another."""
        return self.taken >= self._in_all

    def has(self, person: str) -> bool:
        return person in self._of

    def __iter__(self) -> Iterator[Slot]:
        return (place for own in list(self._of.values()) for place in list(own))

    def end(self, place: Slot) -> None:
        """Free a slot and close its connection."""
        self.give_back(place)
        self.evicted += 1
        place.close()

    def _giving(self, newcomer: str, before_s: float) -> list[Slot]:
        """Choose the person with the most slots among those who may lose one to the newcomer, and
        return that person's slots."""
        own = self._of.get(newcomer, [])
        yielding = [places for person, places in self._of.items() if not self._is_protected(person)]
        if self._is_protected(newcomer):
            yielding = yielding or list(self._of.values())
        most = max(map(len, yielding), default=0)

        def gives(places: list[Slot]) -> bool:
            if places is own and any(one.idle_s < math.inf for one in own):
                return True
            # Take a slot only from a person who keeps at least as many slots as the newcomer will
            # have. Otherwise the two persons would evict each other in turn.
            has_more = len(places) > len(own) + 1 or (places is own and len(own) == most)
            return (has_more or self._is_protected(newcomer)) and any(
                one.gives_way(before_s) for one in places
            )

        return max(filter(gives, yielding), key=len, default=[])

    def _evict(self, own: list[Slot]) -> None:
        self.end(min(own, key=Slot.rank))


class AdmissionControl:
    """Counts connections, websockets and requests.

    Args:
        capacity: The number of connections that the process may open.
        is_protected: Returns True for the owner, the pilot and the teacher.
        recognise: Returns a request's session, found by its first bytes and address; None if
            unknown.
    """

    def __init__(
        self,
        limits: NetworkLimits,
        capacity: int,
        is_protected: Callable[[str], bool] = lambda person: False,
        recognise: Callable[[bytes, str], Session | None] = lambda head, address: None,
    ) -> None:
        self.limits = limits
        self._is_protected, self._recognise = is_protected, recognise
        n_pending = min(limits.pending, max(1, capacity // 2))
        # All pending connections have the same priority: the server knows only their addresses.
        self.pending = ConnectionLimiter(
            n_pending, limits.pending_per_address, lambda address: True
        )
        self.admitted = ConnectionLimiter(
            capacity - n_pending, limits.connections_each, is_protected
        )
        self.sockets = ConnectionLimiter(limits.clients, limits.clients_each, is_protected)
        # Limit uploads, because each upload takes as much memory as a model's file.
        self.uploads = ConnectionLimiter(limits.uploads, 1, is_protected)
        self.connections: dict[Peer, Slot] = {}
        self._paces = RateLimits()
        self._read_until_s = self._asked_s = self._expired_s = 0.0

    def has_room(self, now_s: float) -> bool:
        """False if a new connection would evict one that the server has not had time to read."""
        # Count only a part of a long gap between two calls, because a busy computer reads no
        # requests during the gap.
        self._read_until_s += min(now_s - self._asked_s, _READ_S / 8)
        self._asked_s = now_s
        if not self.pending.is_full:
            return True
        first = min(self.pending, key=Slot.rank)
        return first.idle_s < math.inf or self._read_until_s - first.came_s >= _READ_S

    def arrive(self, peer: Peer, now_s: float, close: Callable[[], None]) -> None:
        """Add a new connection as pending; `close` is called if the connection is evicted."""
        self.expire(now_s)
        if before := self.connections.get(peer):  # the client's system has reused a port
            self.left(peer)
            before.close()
        # The word before the address keeps this name different from every session's name.
        stranger = Session(Role.VIEWER, f"stranger {address_key(peer[0])}")
        place = self.pending.take(stranger, now_s, lambda: self._close(peer, close))
        assert place is not None, "a new connection always gets a pending slot"
        place.came_s = self._read_until_s
        self.connections[peer] = place

    def may_come(self, head: bytes, address: str, now_s: float) -> bool:
        """Count a new connection for the session whose cookie is in its first bytes.

        Returns:
            False if the session opens connections too fast. The listener then answers 429 without
            parsing the request, so the answer costs little.
        """
        session = self._recognise(head, address)
        if session is None or session.is_crowd:
            return True
        each = self.limits.connections_each
        name = f"admission {session.name}"
        if self._paces.allows(name, now_s, per_second=each / 2, burst=each):
            return True
        if self.may_log(session.name, "connections", now_s):
            log.warning(
                "refused reason=connections: one session may open %d connections at once and %d a "
                "second; reuse connections, or wait for Retry-After",
                each,
                each // 2,
            )
        return False

    def asked(self, peer: Peer, session: Session | None, now_s: float, *, lasts: bool) -> bool:
        """Record that a request was read completely; admit its connection if it has a session.

        Args:
            lasts: True if the request opens a websocket. If all connections of the session are
                busy, a websocket evicts the least recently used one.

        Returns:
            False if all connections of the session are busy; the request is then answered with 429.
        """
        place = self.connections.get(peer)
        if place is None:
            return True
        place.used_s, place.idle_s = now_s, math.inf
        is_refused = False
        if session is not None and place.person != session.name:
            self.admitted.give_back(place)
            take = partial(self.admitted.take, session, now_s, place.close)
            is_at_limit = self.admitted.is_at_limit(session)
            admitted = take(answer_s=self.limits.idle_s)
            if admitted is None and lasts and (is_at_limit or self._is_protected(session.name)):
                admitted = take()
            # the connection has lost its slot, which belonged to another session
            if admitted is None and not place.is_taken:
                place.close()
                return True
            if admitted is not None:
                self.pending.give_back(place)
                self.connections[peer] = place = admitted
            else:  # no connection can be evicted: answer this request without a slot of its own
                place.is_known, is_refused = True, is_at_limit
                if is_refused:
                    place.idle_s = now_s  # idle, so it is evicted before busy connections
        place.came_s = self._read_until_s + _ANSWER_S * place.is_known
        if lasts:
            place.used_s = math.inf
        return not is_refused

    def may_log(self, person: str, reason: str, now_s: float) -> bool:
        """True if nothing was logged about this person and reason within the last minute."""
        return self._paces.allows(f"{reason} {person}", now_s, per_second=1 / _LOG_S, burst=1)

    def is_idle(self, peer: Peer) -> bool:
        """True if a connection's last request has been answered."""
        return peer in self.connections and self.connections[peer].idle_s < math.inf

    def answered(self, peer: Peer, now_s: float) -> None:
        """Record that a request was answered, so that its connection is idle and can be evicted."""
        if peer in self.connections:
            self.connections[peer].idle_s = now_s

    def left(self, peer: Peer) -> None:
        place = self.connections.pop(peer, None)
        if place is not None:
            self.pending.give_back(place)
            self.admitted.give_back(place)

    def expire(self, now_s: float) -> None:
        """Close pending connections that have timed out.

        Time in which the computer was blocked does not count, because the server could not read.
        """
        held_up_s = max(0.0, now_s - self._expired_s - _SELDOM_S)
        self._expired_s = now_s
        for place in self.pending:
            place.used_s += held_up_s
            if now_s - place.used_s >= self.limits.pending_s and not place.is_known:
                self.pending.end(place)

    def may_ask(self, session: Session, now_s: float) -> bool:
        """Count a request; return False if the session sends too many per second.

        The rate limit of a crowd (`Session.is_crowd`) is `clients` times as high.
        """
        share = self.limits.clients if session.is_crowd else 1
        rate, burst = self.limits.requests_per_second, self.limits.requests_burst
        return self._paces.allows(session.name, now_s, per_second=share * rate, burst=share * burst)

    def _close(self, peer: Peer, close: Callable[[], None]) -> None:
        close()
        self.connections.pop(peer, None)
