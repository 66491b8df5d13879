from __future__ import annotations

import pytest

from robot.policy.unknown_ahead import MOST, UnknownAhead
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
CLEAR = {F: 0.7, L: 0.2, R: 0.1}


def doubts(novelties, under_way=F, rate_hz=30, unknown=None, shares=CLEAR):
    """Return the doubt at each of some views, taught as novelty by seconds."""
    unknown = unknown or UnknownAhead()
    n_views = round(rate_hz * novelties[-1][0])
    found = []
    for i in range(n_views):
        now_s = i / rate_hz
        novelty = next(value for until_s, value in novelties if now_s < until_s)
        found.append(unknown.doubt(novelty, shares, under_way, 100.0 + now_s))
    return found


def approach(to, seconds=2.0, parts=100):
    """Return a novelty that rises from 0.5 after four seconds on known views."""
    steps = [
        (4.0 + seconds * (i + 1) / parts, 0.5 + (to - 0.5) * (i + 1) / parts) for i in range(parts)
    ]
    return [(4.0, 0.5), *steps]


def test_views_that_are_known_give_no_reason_to_doubt():
    assert not any(doubts([(2.0, 0.0), (4.0, 0.9), (6.0, 0.4), (8.0, 1.0)]))


def test_forward_loses_more_votes_the_less_known_the_view_grows():
    found = doubts(approach(to=1.8))
    assert not any(found[: 4 * 30])
    rising = [doubt for doubt in found[4 * 30 :] if doubt > 0.0]
    assert len(rising) > 20
    assert rising == sorted(rising)
    assert 0.3 < rising[-1] <= MOST


@pytest.mark.parametrize("rate_hz", [4, 10, 15, 60])
def test_the_rate_of_frames_makes_little_difference(rate_hz):
    usual = doubts(approach(to=1.8))[-1]
    assert doubts(approach(to=1.8), rate_hz=rate_hz)[-1] == pytest.approx(usual, abs=0.12)


def test_where_every_view_is_novel_forward_is_as_good_as_any_move():
    """In other light: the doubt of the first moment passes, and does not come back."""
    found = doubts([(2.0, 0.3), (30.0, 2.5)])
    assert max(found) == MOST
    assert found[-1] < 0.01


def test_a_drive_that_begins_in_the_unknown_begins_without_doubt():
    assert not any(doubts([(10.0, 3.0)]))


def test_a_single_strange_frame_is_not_enough():
    assert max(doubts([(2.0, 0.5), (2.0 + 1 / 30, 1.4), (4.0, 0.5)])) < 0.1


@pytest.mark.parametrize("under_way", [L, Action.BACKWARD, None])
def test_only_forward_is_doubted(under_way):
    assert not any(doubts(approach(to=3.0), under_way))


@pytest.mark.parametrize(
    "shares",
    [
        {F: 0.7, L: 0.17, R: 0.13},
        {F: 0.7, Action.SPIN_LEFT: 0.15, Action.SPIN_RIGHT: 0.15},
        {F: 1.0, L: 0.0, R: 0.0},
        {F: 0.6, Action.BACKWARD: 0.4},
        {F: 1.0},
    ],
)
def test_there_is_no_doubt_where_the_turn_would_be_a_guess(shares):
    assert not any(doubts(approach(to=3.0), shares=shares))


@pytest.mark.parametrize(
    "shares",
    [
        {F: 0.9, L: 0.1},
        {F: 0.9, L: 0.1, R: 0.0},
        {F: 0.8, L: 0.05, R: 0.15},
        {F: 0.7, L: 0.2, Action.SPIN_LEFT: 0.1},
        {F: 0.7, Action.SPIN_LEFT: 0.1, Action.SPIN_RIGHT: 0.2},
    ],
)
def test_a_side_that_is_clear_need_not_have_many_votes(shares):
    assert doubts(approach(to=3.0), shares=shares)[-1] > 0.3


def test_novelty_is_followed_while_the_side_is_not_clear():
    unknown = UnknownAhead()
    doubts(approach(to=1.8), shares={F: 0.6, L: 0.2, R: 0.2}, unknown=unknown)
    found = unknown.doubt(1.8, CLEAR, F, 106.0)
    assert found == pytest.approx(doubts(approach(to=1.8))[-1], abs=0.03)


def test_when_the_pilot_has_driven_the_past_does_not_count():
    unknown = UnknownAhead()
    doubts(approach(to=3.0), F, unknown=unknown)
    unknown.doubt(3.0, CLEAR, None, 107.0)
    assert unknown.doubt(3.0, CLEAR, F, 107.1) == 0.0


def test_a_new_drive_knows_nothing_of_the_last():
    unknown = UnknownAhead()
    assert doubts(approach(to=3.0), F, unknown=unknown)[-1] > 0.0
    unknown.reset()
    assert unknown.doubt(3.0, CLEAR, F, 50.0) == 0.0


def test_a_clock_that_runs_backward_lets_no_time_pass():
    unknown = UnknownAhead()
    last = doubts(approach(to=1.4), F, unknown=unknown)[-1]
    assert 0.0 < last < MOST
    assert unknown.doubt(0.0, CLEAR, F, 50.0) == last
