from __future__ import annotations

import numpy as np
import pytest

from robot.policy.action_filter import (
    STRAIGHT_INERTIA,
    TURN_INERTIA,
    ActionFilter,
    Commitment,
    RunningVotes,
    View,
)
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def test_one_odd_frame_does_not_turn_the_average():
    votes = RunningVotes(0.75)
    for _ in range(10):
        votes.update({F: 1.0, L: 0.0})
    assert votes.update({F: 0.0, L: 1.0})[F] == pytest.approx(0.75)
    votes.reset()
    assert votes.update({F: 0.0, L: 1.0})[L] == 1.0


def test_left_and_right_never_follow_each_other():
    commitment = Commitment()
    assert commitment.choose({F: 0.1, L: 0.5, R: 0.4}) is L
    assert commitment.choose({F: 0.1, L: 0.2, R: 0.7}) is L
    assert commitment.choose({F: 0.5, L: 0.1, R: 0.4}) is F
    assert commitment.choose({F: 0.1, L: 0.2, R: 0.7}) is L, "one frame straight pays nothing back"
    commitment.free()
    assert commitment.choose({F: 0.1, L: 0.2, R: 0.7}) is R


def test_a_move_under_way_goes_on_until_another_is_clearly_better():
    commitment = Commitment()
    little, much = 0.5 + 0.4 * TURN_INERTIA, 0.5 + 0.6 * TURN_INERTIA
    assert commitment.choose({F: little, L: 1 - little}, L) is L
    assert commitment.choose({F: little, L: 1 - little}) is F
    assert commitment.choose({F: much, L: 1 - much}, L) is F


def test_driving_straight_yields_sooner_than_a_turn():
    commitment = Commitment()
    between = 0.5 + 0.25 * (STRAIGHT_INERTIA + TURN_INERTIA)
    assert commitment.choose({F: between, L: 1 - between}, L) is L
    assert commitment.choose({F: 1 - between, L: between}, F) is L


def test_standing_still_is_no_move_under_way():
    assert Commitment().choose({F: 0.4, L: 0.6}, Action.STOP) is L


@pytest.mark.parametrize("rate_hz", [5, 10, 30])
@pytest.mark.parametrize("timed_s", [None, 1.0, 2.0])
@pytest.mark.parametrize("forward", [0.5, 0.8])
def test_a_turn_by_the_clock_ends_when_its_time_is_over_and_not_before(rate_hz, timed_s, forward):
    """Votes for FORWARD until then, and for the turn from then on: both in vain."""
    actions, doing, turned_s = ActionFilter(), L, 0.0
    for number in range(1, 3 * rate_hz):
        at_s = number / rate_hz
        share = forward if timed_s is None or at_s < timed_s else 1.0 - forward
        doing = choose(actions, {F: share, L: 1.0 - share, R: 0.0}, doing, at_s, timed_s)
        if doing is not L:
            break
        turned_s = at_s
    without_clock_s = 0.0 if forward > 0.5 + 0.5 * TURN_INERTIA else 3.0
    expected_s = without_clock_s if timed_s is None else timed_s
    assert turned_s == pytest.approx(expected_s, abs=0.1 + 2 / rate_hz)


@pytest.mark.parametrize(
    ("left", "timed_s", "expected"),
    [(0.65, None, L), (0.65, 2.0, F), (0.85, 2.0, L)],
)
def test_who_turns_by_the_clock_begins_a_turn_only_on_a_clear_view(left, timed_s, expected):
    assert choose(ActionFilter(), {F: 1.0 - left, L: left}, F, 0.1, timed_s) is expected


def choose(actions, shares, doing, at_s, timed_s):
    picture = np.random.default_rng(round(at_s * 1000)).integers(0, 255, 1200).astype(np.uint8)
    return actions.choose(
        shares,
        View(picture=picture, at_s=at_s, bumped=False),
        doing,
        longest_debt_s=12.0,
        patience_s=0.5,
        timed_turn_s=timed_s,
    )
