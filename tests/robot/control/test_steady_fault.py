from __future__ import annotations

import random

from robot.control.state import STEADY_S, SteadyFault
from robot.devkit.freshness import Freshness

_TICK_S = 0.05


def test_a_fault_is_shown_at_once_and_goes_when_it_is_over() -> None:
    steady = SteadyFault()
    assert steady.show("the hub is lost", 0.0, may_move=False) == "the hub is lost"
    assert steady.show(None, 1.0, may_move=False) == "the hub is lost"
    assert steady.show(None, STEADY_S, may_move=False) is None
    assert steady.show("again", STEADY_S, may_move=False) == "again"
    assert steady.show(None, STEADY_S + 0.1, may_move=True) is None, "it was started since"


def test_each_shown_fault_stays_for_at_least_three_seconds() -> None:
    """A fault that counts seconds, causes that alternate, a camera that repeats once a second."""
    chance = random.Random(5)
    steady, shown, changed_s = SteadyFault(), None, -STEADY_S
    for tick in range(4000):
        now_s = tick * _TICK_S
        fault = chance.choice((None, "repeats", "nothing", f"silent for {now_s:.1f} s"))
        now = steady.show(fault, now_s, may_move=False)
        if now != shown:
            assert now_s - changed_s >= STEADY_S - 1e-9
            shown, changed_s = now, now_s


def test_a_camera_that_repeats_a_picture_once_a_second_is_reported() -> None:
    freshness, said = Freshness(0.0), set()
    for tick in range(200):
        now_s = tick * _TICK_S
        if tick % 20 == 0:
            freshness.is_new(b"the same", now_s)
        if now_s > 2.0:
            said.add(freshness.fault(now_s))
    assert said == {"repeats one picture"}
    assert freshness.fault(20.0) == "gives no pictures"
