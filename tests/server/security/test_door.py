"""Whatever pending connections do: limits hold, and admitted connections stay."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.config import Limits
from server.security.door import Door, Newest, Peer, address_key

LIMITS = Limits(pending=6, pending_per_address=3, pending_s=5.0)
ADDRESSES = ("10.0.0.1", "10.0.0.2", "fe80::1", "fe80::2", "2001:db8::1")
STEPS = st.lists(
    st.tuples(
        st.sampled_from(["arrive", "asked", "admit", "leave", "wait"]),
        st.sampled_from(ADDRESSES),
        st.integers(1, 8),
    ),
    max_size=120,
)


@settings(deadline=None)
@given(STEPS, st.integers(1, 12))
def test_bounds_hold_and_the_admitted_stay(
    steps: list[tuple[str, str, int]], capacity: int
) -> None:
    door, now_s = Door(LIMITS, capacity), 0.0
    pending: dict[Peer, float] = {}
    admitted: set[Peer] = set()

    for what, address, port in steps:
        peer = (address, port)
        if what == "arrive" and peer not in pending and peer not in admitted:

            def close(peer: Peer = peer) -> None:
                assert peer not in admitted, "an admitted connection is closed"
                del pending[peer]

            pending[peer] = now_s
            if not door.arrive(peer, now_s, close):
                del pending[peer]
                assert len(admitted) == capacity, "turned away although there is room"
        elif what == "asked":
            door.asked(peer, now_s)
            if peer in pending:
                pending[peer] = now_s
        elif what == "admit" and peer in pending:
            door.admit(peer)
            del pending[peer]
            admitted.add(peer)
        elif what == "leave":
            door.left(peer)
            pending.pop(peer, None)
            admitted.discard(peer)
        elif what == "wait":
            now_s += port
            door.expire(now_s)
            assert all(now_s - since_s < LIMITS.pending_s for since_s in pending.values())
        assert door.open == len(pending) + len(admitted) <= capacity
        assert len(pending) <= LIMITS.pending
        for one in ADDRESSES:
            mine = [p for p in pending if address_key(p[0]) == address_key(one)]
            assert len(mine) <= LIMITS.pending_per_address


def test_a_newcomer_has_a_moment_in_the_middle_of_a_flood() -> None:
    door, gone = Door(LIMITS, 100), list[int]()
    for port in range(1, 6000):
        door.arrive(("10.0.0.1", port), 0.0, lambda port=port: gone.append(port))
    door.arrive(("10.0.0.2", 1), 0.0, lambda: gone.append(0))
    for port in range(6000, 6100):
        door.arrive(("10.0.0.1", port), 0.0, lambda port=port: gone.append(port))
    assert 0 not in gone, "a flood pushes out itself, not others"
    assert gone == sorted(gone), "the oldest first"


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
def test_what_counts_as_one_address(one: str, other: str, same: bool) -> None:
    assert (address_key(one) == address_key(other)) == same


@given(st.lists(st.sampled_from(ADDRESSES), max_size=200))
def test_of_a_flood_the_newest_of_each_address_are_kept(arrivals: list[str]) -> None:
    newest = Newest(per_address=3, in_all=6)
    gone: list[int] = []
    for number, address in enumerate(arrivals):
        gone += newest.add(address, number)
    kept = list(newest)
    assert sorted(kept + gone) == list(range(len(arrivals))), "none is forgotten, none is doubled"
    assert kept == sorted(kept) and len(kept) <= 6
    for address in ADDRESSES:
        own = [number for number, one in enumerate(arrivals) if one == address]
        still = [number for number in own if number in kept]
        assert len(still) <= 3
        assert still == own[len(own) - len(still) :], "the oldest goes first"


def test_a_flood_costs_another_address_nothing() -> None:
    newest = Newest(per_address=3, in_all=6)
    newest.add("10.0.0.1", "a phone")
    for number in range(5_000):
        assert "a phone" not in newest.add("10.0.0.2", number)
    assert "a phone" in list(newest)
