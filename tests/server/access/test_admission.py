"""Whatever connections people open, limits hold, and people with few connections keep them."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

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
KEPT = ("owner", "pilot")


class PeopleAtTheDoor(RuleBasedStateMachine):
    """Connections are opened, send requests, idle and end; some people want all slots."""

    def __init__(self) -> None:
        super().__init__()
        self.admission, self.now_s, self.port = AdmissionControl(LIMITS, CAPACITY), 0.0, 0
        self.admission.keeps = KEPT.__contains__
        self.connections: dict[Peer, str | None] = {}
        self.closed: list[Peer] = []

    @rule(address=st.sampled_from(ADDRESSES), times=st.sampled_from([1, 1, 3, 40]))
    def arrive(self, address: str, times: int) -> None:
        for _ in range(times):
            self.port += 1
            peer = (address, self.port)
            self.connections[peer] = None

            def close(peer: Peer = peer) -> None:
                del self.connections[peer]
                self.closed.append(peer)
                self.admission.left(peer)

            self.admission.arrive(peer, self.now_s, close)
            assert peer in self.connections, "the newest is always accepted"

    @rule(person=st.sampled_from((*PEOPLE, None)), pick=st.integers(0, 50), lasts=st.booleans())
    def ask(self, person: str | None, pick: int, lasts: bool) -> None:
        if self.connections:
            peer = list(self.connections)[pick % len(self.connections)]
            person = person or self.connections[peer]
            self._ask(peer, person, lasts=lasts)

    def _ask(self, peer: Peer, person: str | None, *, lasts: bool) -> None:
        role = Role.PILOT if person in KEPT else Role.VIEWER
        session = None if person is None else Session(role=role, name=person)
        waiting = self.admission.pending.taken
        self.admission.asked(peer, session, self.now_s, lasts=lasts)
        if self.admission.pending.taken < waiting or self.connections.get(peer) is not None:
            self.connections[peer] = person

    @rule(pick=st.integers(0, 50))
    def answer(self, pick: int) -> None:
        if self.connections:
            self.admission.answered(
                list(self.connections)[pick % len(self.connections)], self.now_s
            )

    @rule(pick=st.integers(0, 50))
    def leave(self, pick: int) -> None:
        if self.connections:
            peer = list(self.connections)[pick % len(self.connections)]
            del self.connections[peer]
            self.admission.left(peer)

    @rule(seconds=st.floats(0.0, 6.0))
    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        self.admission.expire(self.now_s)

    @rule(address=st.sampled_from(ADDRESSES), person=st.sampled_from(KEPT))
    def a_stop_arrives(self, address: str, person: str) -> None:
        """Whatever happened before, the connection is accepted, and is still open when it is
        read."""
        self.arrive(address, 1)
        peer = (address, self.port)
        self._ask(peer, person, lasts=False)
        assert peer in self.connections

    @rule(address=st.sampled_from(ADDRESSES), person=st.sampled_from(KEPT))
    def who_drives_comes_back(self, address: str, person: str) -> None:
        self.arrive(address, 1)
        peer = (address, self.port)
        self._ask(peer, person, lasts=True)
        assert self.connections[peer] == person, "it need not wait for anybody's answer"

    @invariant()
    def the_books_agree(self) -> None:
        assert len(self.admission.connections) == len(self.connections) <= CAPACITY
        pending = [peer for peer, person in self.connections.items() if person is None]
        assert self.admission.pending.taken == len(pending) <= LIMITS.pending
        assert self.admission.admitted.taken == len(self.connections) - len(pending)
        for person in PEOPLE:
            n_own = sum(one == person for one in self.connections.values())
            assert n_own <= LIMITS.connections_each
            assert self.admission.admitted.has(person) == (n_own > 0)


TestPeopleAtTheDoor = PeopleAtTheDoor.TestCase
TestPeopleAtTheDoor.settings = settings(
    deadline=None, max_examples=examples(200), stateful_step_count=60
)


def test_a_newcomer_is_served_in_the_middle_of_a_flood() -> None:
    admission, gone = AdmissionControl(LIMITS, 100), list[int]()
    for port in range(1, 6000):
        admission.arrive(("10.0.0.1", port), 0.0, lambda port=port: gone.append(port))
    admission.arrive(("10.0.0.2", 1), 0.0, lambda: gone.append(0))
    for port in range(6000, 6100):
        admission.arrive(("10.0.0.1", port), 0.0, lambda port=port: gone.append(port))
    assert 0 not in gone, "a flood pushes out itself, not others"
    assert gone == sorted(gone), "the oldest first"


@pytest.mark.parametrize("held_up_s", [0.0, 3.0, 60.0])
def test_a_silent_connection_is_closed_but_not_because_the_computer_was_blocked(
    held_up_s: float,
) -> None:
    admission, gone = AdmissionControl(LIMITS, CAPACITY), list[int]()
    admission.arrive(("10.0.0.1", 1), 1000.0, lambda: gone.append(1))
    admission.arrive(("10.0.0.1", 2), 1000.0, lambda: gone.append(2))
    admission.asked(("10.0.0.1", 2), None, 1000.0, lasts=True)
    admission.expire(now_s := 1000.5 + held_up_s)
    assert not gone
    while not gone:
        admission.expire(now_s := now_s + 0.5)
    assert 4.0 <= now_s - held_up_s - 1000.0 <= LIMITS.pending_s + 0.5
    admission.expire(now_s + 3600.0)
    assert gone == [1], "a websocket stays"


@pytest.mark.parametrize("address", ADDRESSES)
def test_without_pairing_an_answer_may_take_long(address: str) -> None:
    """A board copies a model from robot to robot, and reports the failures at the end."""
    admission, gone = AdmissionControl(LIMITS, CAPACITY), list[int]()
    person = Session(Role.PILOT, address_key(address), is_crowd=True)
    for port in range(8):
        admission.arrive((address, port), 0.0, lambda port=port: gone.append(port))
        admission.asked((address, port), person, 0.1, lasts=False)
    for second in range(60):
        admission.expire(float(second))
    assert not gone and len(admission.connections) == 8


def test_no_answer_is_cut_short_for_the_request_of_somebody_else() -> None:
    """Pages that load together open more connections than there are places for admitted ones."""
    admission, gone = (
        AdmissionControl(NetworkLimits(pending=6, connections_each=6), 16),
        list[Peer](),
    )
    people = [Session(role=Role.PILOT, name=name) for name in ("one", "other", "third")]
    busy = [(f"10.0.0.{n}", port) for port in range(5) for n in range(3)]
    for peer in busy:
        admission.arrive(peer, 0.0, lambda peer=peer: gone.append(peer))
        admission.asked(peer, people[int(peer[0][-1])], 0.0, lasts=False)
    for second in range(int(LIMITS.idle_s)):
        admission.expire(float(second))
    assert not gone and admission.admitted.taken == 10 and admission.pending.taken == 5

    admission.answered(busy[4], 29.0)
    admission.asked(busy[-2], people[1], 29.5, lasts=False)
    assert gone == [busy[4]], "the connection that waits for a request gives way"
    admission.asked(busy[-1], people[2], 30.5, lasts=False)
    assert gone == [busy[4]], "nobody has more than this one"


def test_a_newcomer_waits_for_an_idle_place_before_it_takes_a_busy_one() -> None:
    """A class whose pages load at once: with few slots, newcomers ended connections that others
    needed."""
    admission, gone, now_s = (
        AdmissionControl(NetworkLimits(pending=6, connections_each=6), 16),
        list[Peer](),
        0.0,
    )

    def come(port: int) -> Peer:
        peer = ("10.0.0.1", port)
        admission.arrive(peer, now_s, lambda: gone.append(peer))
        return peer

    def wait_s() -> float:
        nonlocal now_s
        start_s = now_s
        while not admission.has_room(now_s):
            now_s += 0.02
        return now_s - start_s

    peers = []
    for port in range(16):
        peers.append(come(port))
        admission.asked(peers[-1], Session(Role.PILOT, f"page {port % 4}"), now_s, lasts=port == 10)
    assert not gone and admission.pending.taken == 6
    for _ in range(20):
        now_s += 0.02
        assert not admission.has_room(now_s), "nobody's answer is cut short as soon as it was read"
    admission.answered(peers[13], now_s)
    assert admission.has_room(now_s)
    newcomer = come(16)
    assert gone == [peers[13]], "an idle connection before all others"
    assert 0.2 < wait_s() < 0.4
    come(17)
    assert gone[-1] == newcomer, "who has said nothing before who waits for an answer"
    for port in range(18, 30):
        admission.asked(come(port), Session(Role.PILOT, "other"), now_s, lasts=False)
        assert wait_s() < 2.5, "a STOP need not wait for who never gets an answer"
    assert set(peers[11:]) < set(gone) and peers[10] not in gone, "a websocket stays"


def test_a_stop_is_obeyed_even_if_all_websocket_slots_are_taken() -> None:
    admission, now_s = AdmissionControl(NetworkLimits(pending=6), 16), 0.0
    for port in range(16):
        admission.arrive(("10.0.0.1", port), now_s, lambda: None)
        admission.asked(("10.0.0.1", port), Session(Role.PILOT, f"page {port}"), now_s, lasts=True)
    while not admission.has_room(now_s):
        now_s += 0.02
    assert now_s < 2.5, "they were there before"


def test_a_request_that_hangs_gives_way_in_the_end() -> None:
    admission, gone = (
        AdmissionControl(NetworkLimits(pending=6, connections_each=20), 16),
        list[int](),
    )
    for port in range(10):
        admission.arrive(("10.0.0.1", port), 0.0, lambda port=port: gone.append(port))
        admission.asked(("10.0.0.1", port), Session(Role.VIEWER, "greedy"), 0.0, lasts=False)
    for port, now_s in enumerate((1.0, LIMITS.idle_s + 1.0), 10):
        assert not gone
        admission.arrive(("10.0.0.2", port), now_s, lambda port=port: gone.append(port))
        admission.asked(("10.0.0.2", port), Session(Role.VIEWER, "other"), now_s, lasts=False)
    assert gone == [0] and admission.admitted.has("other")


def test_a_session_whose_connections_are_all_busy_gets_429_and_keeps_them() -> None:
    admission, gone = AdmissionControl(NetworkLimits(connections_each=4), 500), list[int]()
    session = Session(Role.PILOT, "a curl loop")

    def come(port: int, now_s: float, *, lasts: bool = False) -> bool:
        admission.arrive(("10.0.0.1", port), now_s, lambda: gone.append(port))
        return admission.asked(("10.0.0.1", port), session, now_s, lasts=lasts)

    assert [come(port, 1.0) for port in range(10)] == [True] * 4 + [False] * 6
    assert not gone
    admission.answered(("10.0.0.1", 2), 2.0)
    assert come(10, 3.0) and gone == [2], "an idle one gives way"
    assert not come(11, 4.0)
    assert come(12, 5.0, lasts=True) and gone == [2, 0], "a page's socket always finds a place"
    assert come(13, 1.0 + LIMITS.idle_s + 1.0) and gone == [2, 0, 1], "a request that hangs, too"


def test_a_person_with_many_connections_never_evicts_a_person_with_fewer() -> None:
    places = ConnectionLimiter(8, 6, KEPT.__contains__)
    gone = list[str]()

    def come(person: str, now_s: float) -> bool:
        session = Session(role=Role.VIEWER, name=person)
        return places.take(session, now_s, lambda: gone.append(person)) is not None

    assert all(come("greedy", n) for n in range(8)) and gone == ["greedy"] * 2
    assert come("viewer", 9) and come("other", 10) and gone == ["greedy"] * 2
    assert come("third", 11) and gone == ["greedy"] * 3
    assert all(come("owner", 12 + n) for n in range(6))
    assert gone.count("owner") == 0 and places.has("owner")
    assert not come("fourth", 20), "two are left for three others"
    assert come("pilot", 21), "who drives has a place whoever wants one"


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
def test_addresses_of_one_host_count_as_one(one: str, other: str, same: bool) -> None:
    assert (address_key(one) == address_key(other)) == same
