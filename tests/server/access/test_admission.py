"""Whatever connections are opened, limits hold, and people with few connections keep them."""

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from server.access.admission import AdmissionControl, ConnectionLimiter, Peer, address_key
from server.access.config import NetworkLimits
from server.gateway.roles import Role, Session
from tests.kit.sizes import examples

LIMITS = NetworkLimits(
    pending=6, pending_per_address=4, pending_s=5.0, connections_each=4, clients=8, clients_each=3
)
CAPACITY = 16
ADDRESSES = ("10.0.0.1", "10.0.0.2", "fe80::1", "fe80::2", "2001:db8::1")
PEOPLE = ("owner", "pilot", "viewer", "greedy", "other")
PROTECTED = ("owner", "pilot")


class CompetingClients(RuleBasedStateMachine):
    """Connections open, send requests, become idle and end; some people want all slots."""

    def __init__(self) -> None:
        super().__init__()
        self.admission = AdmissionControl(LIMITS, CAPACITY, PROTECTED.__contains__)
        self.now_s, self.port = 0.0, 0
        self.connections: dict[Peer, str | None] = {}

    @rule(address=st.sampled_from(ADDRESSES), times=st.sampled_from([1, 1, 3, 40]))
    def arrive(self, address: str, times: int) -> None:
        for _ in range(times):
            self.port += 1
            peer = (address, self.port)
            self.connections[peer] = None

            def close(peer: Peer = peer) -> None:
                del self.connections[peer]
                self.admission.left(peer)

            self.admission.arrive(peer, self.now_s, close)
            assert peer in self.connections, "the newest connection is always accepted"

    def _picked(self, pick: int) -> Peer:
        return list(self.connections)[pick % len(self.connections)]

    @precondition(lambda self: self.connections)
    @rule(person=st.sampled_from((*PEOPLE, None)), pick=st.integers(0, 50), lasts=st.booleans())
    def ask(self, person: str | None, pick: int, lasts: bool) -> None:
        peer = self._picked(pick)
        self._ask(peer, person or self.connections[peer], lasts=lasts)

    def _ask(self, peer: Peer, person: str | None, *, lasts: bool) -> None:
        role = Role.PILOT if person in PROTECTED else Role.VIEWER
        session = None if person is None else Session(role=role, name=person)
        waiting = self.admission.pending.taken
        self.admission.asked(peer, session, self.now_s, lasts=lasts)
        if self.admission.pending.taken < waiting or self.connections.get(peer) is not None:
            self.connections[peer] = person

    @precondition(lambda self: self.connections)
    @rule(pick=st.integers(0, 50))
    def answer(self, pick: int) -> None:
        self.admission.answered(self._picked(pick), self.now_s)

    @precondition(lambda self: self.connections)
    @rule(pick=st.integers(0, 50))
    def leave(self, pick: int) -> None:
        peer = self._picked(pick)
        del self.connections[peer]
        self.admission.left(peer)

    @rule(seconds=st.floats(0.0, 6.0))
    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        self.admission.expire(self.now_s)

    @rule(
        address=st.sampled_from(ADDRESSES), person=st.sampled_from(PROTECTED), lasts=st.booleans()
    )
    def a_protected_person_is_always_admitted(self, address: str, person: str, lasts: bool) -> None:
        """Whatever happened before, a new connection is accepted, and stays open until the server
        reads it."""
        self.arrive(address, 1)
        peer = (address, self.port)
        self._ask(peer, person, lasts=lasts)
        assert peer in self.connections
        if lasts:
            assert self.connections[peer] == person, "the websocket is served at once"

    @invariant()
    def the_counts_agree(self) -> None:
        assert len(self.admission.connections) == len(self.connections) <= CAPACITY
        pending = [peer for peer, person in self.connections.items() if person is None]
        assert self.admission.pending.taken == len(pending) <= LIMITS.pending
        assert self.admission.admitted.taken == len(self.connections) - len(pending)
        for person in PEOPLE:
            n_own = sum(one == person for one in self.connections.values())
            assert n_own <= LIMITS.connections_each
            assert self.admission.admitted.has(person) == (n_own > 0)


TestCompetingClients = CompetingClients.TestCase
TestCompetingClients.settings = settings(
    deadline=None, max_examples=examples(200), stateful_step_count=60
)


class Crowd:
    """An admission control, with the ports of the connections that it has closed, in order."""

    def __init__(self, limits: NetworkLimits = LIMITS, capacity: int = CAPACITY) -> None:
        self.control, self.gone = AdmissionControl(limits, capacity), list[int]()
        self.now_s = 0.0

    def arrive(self, port: int, address: str = "10.0.0.1") -> Peer:
        self.control.arrive((address, port), self.now_s, lambda: self.gone.append(port))
        return address, port

    def ask(self, peer: Peer, person: str | Session | None, *, lasts: bool = False) -> bool:
        """Have a connection send a request; return whether it is served."""
        if isinstance(person, str):
            person = Session(Role.PILOT, person)
        return self.control.asked(peer, person, self.now_s, lasts=lasts)

    def come(self, port: int, person: str | Session, *, lasts: bool = False) -> bool:
        return self.ask(self.arrive(port), person, lasts=lasts)

    def wait_for_room(self) -> float:
        """Wait until the next connection is accepted; return the time that it took."""
        start_s = self.now_s
        while not self.control.has_room(self.now_s):
            self.now_s += 0.02
        return self.now_s - start_s


def test_a_newcomer_is_served_in_the_middle_of_a_flood():
    crowd = Crowd(capacity=100)
    for port in range(1, 6100):
        crowd.arrive(port)
        if port == 5999:
            crowd.arrive(0, "10.0.0.2")
    assert 0 not in crowd.gone, "a flood evicts only its own connections"
    assert crowd.gone == sorted(crowd.gone), "the oldest connections go first"


@pytest.mark.parametrize("held_up_s", [0.0, 3.0, 60.0])
def test_a_silent_connection_is_closed_but_not_because_the_computer_was_blocked(held_up_s):
    crowd = Crowd()
    crowd.now_s = 1000.0
    crowd.arrive(1)
    crowd.ask(crowd.arrive(2), None, lasts=True)
    crowd.control.expire(now_s := 1000.5 + held_up_s)
    assert not crowd.gone
    while not crowd.gone:
        crowd.control.expire(now_s := now_s + 0.5)
    assert 4.0 <= now_s - held_up_s - 1000.0 <= LIMITS.pending_s + 0.5
    crowd.control.expire(now_s + 3600.0)
    assert crowd.gone == [1], "a websocket stays open"


@pytest.mark.parametrize("address", ADDRESSES)
def test_without_pairing_an_answer_may_take_long(address):
    """A board copies a model from robot to robot, and reports the failures at the end."""
    crowd = Crowd()
    for port in range(8):
        peer = crowd.arrive(port, address)
        crowd.ask(peer, Session(Role.PILOT, address_key(address), is_crowd=True))
    for second in range(60):
        crowd.control.expire(float(second))
    assert not crowd.gone and len(crowd.control.connections) == 8


def test_no_answer_is_cut_short_for_the_request_of_somebody_else():
    """Pages that load together open more connections than there are slots for admitted ones."""
    crowd = Crowd(NetworkLimits(pending=6, connections_each=6), 16)
    people = ("one", "other", "third")
    busy = []
    for port in range(15):
        busy.append(crowd.arrive(port, f"10.0.0.{port % 3}"))
        crowd.ask(busy[-1], people[port % 3])
    for second in range(int(LIMITS.idle_s)):
        crowd.control.expire(float(second))
    assert not crowd.gone
    assert crowd.control.admitted.taken == 10 and crowd.control.pending.taken == 5

    crowd.control.answered(busy[4], 29.0)
    crowd.now_s = 29.5
    crowd.ask(busy[13], "other")
    assert crowd.gone == [4], "the idle connection makes room for the waiting request"
    crowd.now_s = 30.5
    crowd.ask(busy[14], "third")
    assert crowd.gone == [4], "nobody else has more connections, so this request waits"


def test_a_new_connection_waits_for_an_idle_slot_before_it_evicts_a_busy_connection():
    """In an earlier version, when a class loaded its pages at once, new connections evicted
    connections in use."""
    crowd = Crowd(NetworkLimits(pending=6, connections_each=6), 16)
    for port in range(16):
        crowd.come(port, f"page {port % 4}", lasts=port == 10)
    assert not crowd.gone and crowd.control.pending.taken == 6
    for _ in range(20):
        crowd.now_s += 0.02
        assert not crowd.control.has_room(crowd.now_s), "no answer is cut short immediately"
    crowd.control.answered(("10.0.0.1", 13), crowd.now_s)
    assert crowd.wait_for_room() == 0.0
    crowd.arrive(16)
    assert crowd.gone == [13], "an idle connection is evicted before all others"
    assert 0.2 < crowd.wait_for_room() < 0.4
    crowd.arrive(17)
    assert crowd.gone[-1] == 16, "silent connections go before waiting requests"
    for port in range(18, 30):
        crowd.come(port, "other")
        assert crowd.wait_for_room() < 2.5, "a STOP does not wait for endless requests"
    assert {11, 12, 13, 14, 15} < set(crowd.gone) and 10 not in crowd.gone, "a websocket stays open"


def test_a_hanging_request_is_evicted_in_the_end_and_a_websocket_for_a_stop():
    crowd = Crowd(NetworkLimits(pending=6), 16)
    for port in range(16):
        crowd.come(port, f"page {port}", lasts=True)
    assert crowd.wait_for_room() < 2.5, "the requests are older than the new connection"
    crowd = Crowd(NetworkLimits(pending=6, connections_each=20), 16)
    for port in range(10):
        crowd.come(port, Session(Role.VIEWER, "greedy"))
    for port, crowd.now_s in enumerate((1.0, LIMITS.idle_s + 1.0), 10):
        assert not crowd.gone
        crowd.ask(crowd.arrive(port, "10.0.0.2"), Session(Role.VIEWER, "other"))
    assert crowd.gone == [0] and crowd.control.admitted.has("other")


def test_a_session_whose_connections_are_all_busy_gets_429_and_keeps_them():
    crowd = Crowd(NetworkLimits(connections_each=4), 500)

    def comes(port, now_s, *, lasts=False):
        crowd.now_s = now_s
        return crowd.come(port, "a curl loop", lasts=lasts)

    assert [comes(port, 1.0) for port in range(10)] == [True] * 4 + [False] * 6
    assert not crowd.gone
    crowd.control.answered(("10.0.0.1", 2), 2.0)
    assert comes(10, 3.0) and crowd.gone == [2], "an idle connection is evicted"
    assert not comes(11, 4.0)
    assert comes(12, 5.0, lasts=True) and crowd.gone == [2, 0], "a page's websocket gets a slot"
    assert comes(13, 2.0 + LIMITS.idle_s) and crowd.gone == [2, 0, 1], "a hanging request goes, too"


def test_a_connection_whose_session_changes_takes_no_slot_of_another_connection():
    crowd = Crowd(NetworkLimits(connections_each=1), 500)
    first, second = crowd.arrive(1), crowd.arrive(2)
    crowd.ask(first, "one")
    crowd.ask(second, "other")
    assert crowd.ask(second, "one") and crowd.gone == [2]
    assert not crowd.control.admitted.has("other")


def test_a_person_with_many_connections_never_evicts_a_person_with_fewer():
    places = ConnectionLimiter(8, 6, PROTECTED.__contains__)
    gone = list[str]()

    def come(person, now_s):
        session = Session(role=Role.VIEWER, name=person)
        return places.take(session, now_s, lambda: gone.append(person)) is not None

    assert all(come("greedy", n) for n in range(8)) and gone == ["greedy"] * 2
    assert come("viewer", 9) and come("other", 10) and gone == ["greedy"] * 2
    assert come("third", 11) and gone == ["greedy"] * 3
    assert all(come("owner", 12 + n) for n in range(6))
    assert gone.count("owner") == 0 and places.has("owner")
    assert not come("fourth", 20), "the owner has six of eight slots"
    assert come("pilot", 21), "the pilot gets a slot in any case"


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("10.0.0.1", "10.0.0.2", False),
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("::ffff:10.0.0.1", "10.0.0.1", True),
        ("fe80::1%eth0", "fe80::1", True),
        ("", "", True),
    ],
)
def test_addresses_of_one_host_count_as_one(one, other, same):
    assert (address_key(one) == address_key(other)) == same
