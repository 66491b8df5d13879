from __future__ import annotations

import numpy as np
import pytest

from robot.policy.action_filter import (
    STRAIGHT_INERTIA,
    TURN_INERTIA,
    VOTES_KEPT,
    ActionFilter,
    RunningVotes,
)
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Seen
from robot.types import DEFAULT_MOVES, Action, Point

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
KINDS = MoveKinds(DEFAULT_MOVES)


def choose(shares, under_way=None, *, in_context=False):
    """Return a new filter's result for the votes on one frame."""
    nothing = np.zeros(1200, np.uint8)
    seen = Seen(number=1, x=nothing, picture=nothing, at_s=0.0, under_way=under_way, shares=shares)
    seen.in_context = in_context
    ActionFilter(KINDS).on_frame(seen)
    return seen.action


def test_a_move_under_way_goes_on_until_another_is_clearly_better():
    little, much = 0.5 + 0.4 * TURN_INERTIA, 0.5 + 0.6 * TURN_INERTIA
    assert choose({F: little, L: 1 - little}, L) is L
    assert choose({F: little, L: 1 - little}) is F
    assert choose({F: much, L: 1 - much}, L) is F


def test_driving_straight_yields_sooner_than_a_turn():
    between = 0.5 + 0.25 * (STRAIGHT_INERTIA + TURN_INERTIA)
    assert choose({F: between, L: 1 - between}, L) is L
    assert choose({F: 1 - between, L: between}, F) is L


def test_with_contexts_only_the_votes_decide():
    assert choose({F: 0.51, L: 0.49}, L, in_context=True) is F


def test_proportional_steering_stays_on_the_side_of_the_current_turn():
    """A pilot who steers proportionally never means to steer from lock to lock at each doubt."""
    little, much = 0.5 + 0.4 * TURN_INERTIA, 0.5 + 0.6 * TURN_INERTIA
    nothing, steady = np.zeros(1200, np.uint8), ActionFilter(KINDS, 0.0)

    def drive(shares, under_way, point):
        seen = Seen(number=1, x=nothing, picture=nothing, under_way=under_way, shares=shares)
        seen.in_context = True
        steady.on_frame(seen)
        seen.point = point  # as the part after it does
        return seen.action

    assert drive({F: 0.0, L: 0.4, R: 0.6}, None, Point(0.8, 0.5)) is R
    assert drive({F: 0.0, L: little, R: 1 - little}, R, Point(0.8, 0.5)) is R
    assert drive({F: little, L: 0.0, R: 1 - little}, R, Point(0.1, 0.5)) is F
    assert drive({F: 0.0, L: 0.4, R: 0.6}, F, Point(0.8, 0.5)) is R
    assert drive({F: 0.0, L: much, R: 1 - much}, R, None) is L
    assert drive({F: 0.0, L: 1 - little, R: little}, L, None) is R  # by moves the votes decide


def test_standing_still_is_no_move_under_way():
    assert choose({F: 0.4, L: 0.6}, Action.STOP) is L


@pytest.mark.parametrize(("usual_run_s", "at_least", "at_most"), [(3.0, 0.3, 0.5), (0.2, 0.0, 0.1)])
def test_the_average_is_no_slower_than_the_pilots_hand(usual_run_s, at_least, at_most):
    votes = RunningVotes(VOTES_KEPT)
    votes.update({F: 1.0, L: 0.0}, 0.1, usual_run_s)
    steady = votes.update({F: 0.0, L: 1.0}, 0.1, usual_run_s)
    assert at_least < steady[F] < at_most


def test_one_odd_frame_does_not_turn_the_average():
    votes = RunningVotes(0.75)
    for _ in range(10):
        votes.update({F: 1.0, L: 0.0})
    assert votes.update({F: 0.0, L: 1.0})[F] == pytest.approx(0.75)
    votes.reset()
    assert votes.update({F: 0.0, L: 1.0})[L] == 1.0


@pytest.mark.parametrize("keep", [-0.1, 1.0, float("nan")])
def test_a_share_outside_its_range_is_refused(keep):
    with pytest.raises(ValueError, match="keep must be in"):
        RunningVotes(keep)


def test_frames_without_times_are_a_tenth_of_a_second_apart():
    timed, untimed = RunningVotes(0.4), RunningVotes(0.4)
    for votes in ({F: 1.0, L: 0.0}, {F: 0.0, L: 1.0}, {F: 0.5, L: 0.5}):
        assert untimed.update(votes) == pytest.approx(timed.update(votes, 0.1))
