from __future__ import annotations

import pytest

from robot.policy.action_filter import RunningVotes
from robot.types import Action

F, L = Action.FORWARD, Action.LEFT


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
