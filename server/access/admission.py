"""What each person may use of the server: the one place that counts. Pure: time is an argument.

Who has a session is counted by it, and only who has none by address. A connection is *pending*
until the guard has read a session on it; pending ones have little time, and places of their own.
So whoever has filled all other places, a new connection is accepted and read: it may be a STOP.
It takes the place of an idle one, else of one that has said nothing, else of an old request.

Where no place is left, the person who has most gives up one: an idle connection, or the one that
was used longest ago. A flood so evicts itself. The owner, the pilot and the teacher give way to
each other alone. Nobody's answer is cut short for a request: where all are busy, it is answered on
a pending connection.
"""

from __future__ import annotations

import ipaddress
import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial

from server.clients.rate_limit import RateLimits
from server.config import Limits, as_address
from server.gateway.roles import Role, Session

log = logging.getLogger(__name__)
Close = Callable[[], object]
Peer = tuple[str, int]
"""Address and port of the remote side, as the socket reports them."""
_READ_S = 0.25
"""By then the first request of a new connection has been read, whatever else goes on."""
_ANSWER_S = 2.0
"""So long newcomers wait for a request's answer, where nobody else can give way to them."""
_LOG_S = 60.0
"""How long the log is silent on a session that goes on opening too many connections, in seconds."""
_SELDOM_S = 1.0
"""`expire` is called more often, unless the computer is busy."""


@lru_cache(maxsize=1024)
def address_key(address: str) -> str:
    """Return what counts as one address: for IPv6 the /64 network, which one host may own."""
    ip = as_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address):
        return str(ipaddress.IPv6Network((ip, 64), strict=False))
    return address if ip is None else str(ip)


@dataclass(slots=True, eq=False)
class Slot:
    """One place in use: a connection or a websocket."""

    person: str
    used_s: float
    close: Close
    came_s: float = 0.0
    idle_s: float = math.inf
    """Since when a connection has waited for the next request; infinite: it does not wait."""
    is_taken: bool = True
    is_known: bool = False
    """True of a pending connection whose session is known: it gives way, but has no time limit."""
    unread: Callable[[], int] = lambda: 0
    """Returns how many bytes were sent that the client has not read, as far as known."""

    def rank(self) -> tuple[float, ...]:
        """Return who gives way first: who is idle; a websocket last of all."""
        return self.idle_s, self.used_s == math.inf, self.came_s, self.used_s


class ConnectionLimiter:
    """ConnectionLimiter of one kind.

    Args:
        in_all: How many there are.
        each: How many of them one person may have; a crowd may have all.
        keeps: True of persons who give way to each other alone.
    """

    def __init__(self, in_all: int, each: int, keeps: Callable[[str], bool]) -> None:
        self._in_all, self._each, self._keeps = max(1, in_all), max(1, each), keeps
        self._of: dict[str, list[Slot]] = {}
        self.taken = self.evicted = 0

    def take(
        self, session: Session, now_s: float, close: Close, answer_s: float = 0.0
    ) -> Slot | None:
        """Take a place, until `close` ends it for who needs it more; None if none is to be had.

        A request that was read less than `answer_s` ago is not cut short for the newcomer.
        """
        own = self._of.get(session.name, [])
        if not session.is_crowd and len(own) >= self._each:
            self._evict(own)
        elif self.is_full:
            giving = self._giving(session.name, now_s - answer_s if answer_s else math.inf)
            if not giving:
                return None
            self._evict(giving)
        place = Slot(session.name, now_s, close)
        self._of.setdefault(session.name, []).append(place)
        self.taken += 1
        return place

    def give_back(self, place: Slot) -> None:
        """Free a place; again does nothing."""
        own = self._of.get(place.person, [])
        if place in own:
            own.remove(place)
            place.is_taken = False
            self.taken -= 1
            if not own:
                del self._of[place.person]

    @property
    def is_full(self) -> bool:
        """True if the next one needs the place of another."""
        return self.taken >= self._in_all

    def has(self, person: str) -> bool:
        return person in self._of

    def __iter__(self) -> Iterator[Slot]:
        return (place for own in list(self._of.values()) for place in list(own))

    def end(self, place: Slot) -> None:
        """Free a place, and close what has it."""
        self.give_back(place)
        self.evicted += 1
        place.close()

    def _giving(self, newcomer: str, before_s: float) -> list[Slot]:
        """Return the places of who has most, of those who have to give way to the newcomer."""
        own = self._of.get(newcomer, [])
        yielding = [places for person, places in self._of.items() if not self._keeps(person)]
        if self._keeps(newcomer):
            yielding = yielding or list(self._of.values())
        most = max(map(len, yielding), default=0)

        def gives(places: list[Slot]) -> bool:
            if places is own and any(one.idle_s < math.inf for one in own):
                return True
            # The newcomer must not have more than the other has left, or both would take turns.
            has_more = len(places) > len(own) + 1 or (places is own and len(own) == most)
            return (has_more or self._keeps(newcomer)) and any(
                one.idle_s < math.inf or one.used_s <= before_s for one in places
            )

        return max(filter(gives, yielding), key=len, default=[])

    def _evict(self, own: list[Slot]) -> None:
        self.end(min(own, key=Slot.rank))


class AdmissionControl:
    """All that is counted: connections, websockets and requests."""

    def __init__(self, limits: Limits, capacity: int) -> None:
        self.limits = limits
        self.keeps: Callable[[str], bool] = lambda person: False
        """True of the owner, the pilot and the teacher."""
        self.recognise: Callable[[bytes, str], Session | None] = lambda head, address: None
        """Returns whose request begins so, of a connection from that address; None: unknown."""
        n_pending = min(limits.pending, max(1, capacity // 2))
        # Newcomers have nothing but an address: none of them goes before another.
        self.pending = ConnectionLimiter(
            n_pending, limits.pending_per_address, lambda address: True
        )
        self.admitted = ConnectionLimiter(
            capacity - n_pending, limits.connections_each, lambda person: self.keeps(person)
        )
        self.sockets = ConnectionLimiter(
            limits.clients, limits.clients_each, lambda person: self.keeps(person)
        )
        # Each takes as much memory as a model's file.
        self.uploads = ConnectionLimiter(limits.uploads, 1, lambda person: self.keeps(person))
        self.connections: dict[Peer, Slot] = {}
        self._paces = RateLimits()
        self._read_until_s = self._asked_s = self._expired_s = 0.0

    def has_room(self, now_s: float) -> bool:
        """True if a new connection need push out none that has had no time to be read."""
        # A computer that is busy has read nothing meanwhile: few of its milliseconds count.
        self._read_until_s += min(now_s - self._asked_s, _READ_S / 8)
        self._asked_s = now_s
        if not self.pending.is_full:
            return True
        first = min(self.pending, key=Slot.rank)
        return first.idle_s < math.inf or self._read_until_s - first.came_s >= _READ_S

    def arrive(
        self,
        peer: Peer,
        now_s: float,
        close: Callable[[], None],
        unread: Callable[[], int] = lambda: 0,
    ) -> None:
        """Add a new connection as pending; `close` ends it, maybe before `left` is called.

        `unread` returns how many bytes were sent that the client has not read, as far as known.
        """
        self.expire(now_s)
        if before := self.connections.get(peer):  # which has ended: its port is used again
            self.left(peer)
            before.close()
        # No session has such a name: where nobody is paired, a session is named by the address.
        stranger = Session(Role.VIEWER, f"stranger {address_key(peer[0])}")
        place = self.pending.take(stranger, now_s, lambda: self._close(peer, close))
        assert place is not None, "a newcomer always finds a place"
        place.came_s, place.unread = self._read_until_s, unread
        self.connections[peer] = place

    def may_come(self, head: bytes, address: str, now_s: float) -> bool:
        """Count a new connection by what waits on it; False if this person opened too many: it is
        answered with 429 where it was accepted, and costs no more."""
        session = self.recognise(head, address)
        if session is None or session.is_crowd:
            return True
        each = self.limits.connections_each
        name = f"admission {session.name}"
        if self._paces.allows(name, now_s, per_second=each / 2, burst=each):
            return True
        if self._paces.allows(f"log {name}", now_s, per_second=1 / _LOG_S, burst=1):
            log.warning(
                "refused reason=connections: one session may open %d connections at once and %d a "
                "second; reuse connections, or wait for Retry-After",
                each,
                each // 2,
            )
        return False

    def asked(self, peer: Peer, session: Session | None, now_s: float, *, lasts: bool) -> None:
        """Record a complete request; one of a session admits the connection. A socket `lasts`."""
        place = self.connections.get(peer)
        if place is None:
            return
        place.used_s, place.idle_s = now_s, math.inf
        if session is not None and place.person != session.name:
            self.admitted.give_back(place)
            take = partial(self.admitted.take, session, now_s, place.close)
            admitted = take(answer_s=self.limits.idle_s)
            if admitted is None and lasts and self.keeps(session.name):
                admitted = take()
            if admitted is None and not place.is_taken:  # whose place it had
                place.close()
                return
            if admitted is not None:
                self.pending.give_back(place)
                admitted.unread = place.unread
                self.connections[peer] = place = admitted
            else:  # nobody can give way: the connection is answered all the same
                place.is_known = True
        place.came_s = self._read_until_s + _ANSWER_S * place.is_known
        if lasts:
            place.used_s = math.inf

    def answered(self, peer: Peer, now_s: float) -> None:
        """Record that a request has its answer: who needs a place takes an idle connection's."""
        if peer in self.connections:
            self.connections[peer].idle_s = now_s

    def left(self, peer: Peer) -> None:
        place = self.connections.pop(peer, None)
        if place is not None:
            self.pending.give_back(place)
            self.admitted.give_back(place)

    def expire(self, now_s: float) -> None:
        """Close pending connections that have timed out.

        A computer that was held up has read nothing meanwhile: that time does not count.
        """
        held_up_s = max(0.0, now_s - self._expired_s - _SELDOM_S)
        self._expired_s = now_s
        for place in self.pending:
            place.used_s += held_up_s
            if now_s - place.used_s >= self.limits.pending_s and not place.is_known:
                self.pending.end(place)

    def may_ask(self, session: Session, now_s: float) -> bool:
        """Count a request; False if there were too many. A crowd may ask as often as all."""
        share = self.limits.clients if session.is_crowd else 1
        rate, burst = self.limits.requests_per_second, self.limits.requests_burst
        return self._paces.allows(session.name, now_s, per_second=share * rate, burst=share * burst)

    def _close(self, peer: Peer, close: Callable[[], None]) -> None:
        self.connections.pop(peer, None)
        close()
