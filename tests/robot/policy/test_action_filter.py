from __future__ import annotations

import numpy as np
import pytest

from robot.policy.action_filter import ActionFilter, View
from robot.policy.commitment import TURN_INERTIA
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


@pytest.mark.parametrize("rate_hz", [5, 10, 30])
@pytest.mark.parametrize("weight", [0.1, 0.3, 1.0])
def test_votes_of_images_count_more_slowly_than_the_others(rate_hz, weight):
    """The images change their minds at once and for good; the other votes stay."""
    actions, early = ActionFilter(votes_kept=0.0, images_kept=0.5), {F: 1.0, L: 0.0}
    for number in range(rate_hz):
        at_s = number / rate_hz
        assert actions.average(early, at_s, {F: weight, L: 0.0})[F] == pytest.approx(1.0)
    for number in range(rate_hz, 3 * rate_hz):
        late = {F: 1.0 - weight, L: weight}
        steady = actions.average(late, number / rate_hz, {F: 0.0, L: weight})
        since_s = (number + 1 - rate_hz) / rate_hz
        assert steady[L] == pytest.approx(weight * (1.0 - 0.5 ** (since_s / 0.1)))
        assert sum(steady.values()) == pytest.approx(1.0)


def test_images_that_do_not_vote_change_nothing():
    actions = ActionFilter(votes_kept=0.0)
    assert actions.average({F: 0.3, L: 0.7}, 0.0, {F: 0.0, L: 0.0}) == {F: 0.3, L: 0.7}


@pytest.mark.parametrize("rate_hz", [8, 10, 15, 30, 60])
def test_a_move_that_has_just_begun_is_judged_in_its_own_context(rate_hz):
    """The unknown ahead begins the turn, with most votes for FORWARD still in the average."""
    votes = {F: {F: 0.75, L: 0.2, R: 0.05}, L: {F: 0.1, L: 0.85, R: 0.05}}
    actions, move, made, chance = ActionFilter(), F, [], np.random.default_rng(0)
    for number in range(4 * rate_hz):
        at_s = number / rate_hz
        picture = chance.integers(0, 255, (30, 40)).astype(np.uint8)
        view = View(picture=picture, at_s=at_s, bumped=False, novelty=1.0 if at_s < 3.0 else 1.7)
        average = actions.average(votes[move], at_s)
        move = actions.choose(
            average, view, move, longest_debt_s=2.0, patience_s=0.5, in_context=True
        )
        made.append(move)
    begun = made.index(L)
    assert begun > 3 * rate_hz
    assert set(made[begun:]) == {L}


@pytest.mark.parametrize(("rate_hz", "n_frames"), [(8, 1), (10, 1), (15, 2), (30, 3), (60, 5)])
@pytest.mark.parametrize(("doing", "other"), [(F, L), (L, F), (Action.BACKWARD, F)])
def test_with_contexts_another_move_has_to_be_ahead_for_as_long_at_any_rate(
    rate_hz, n_frames, doing, other
):
    """A single frame for another move is chance at thirty a second, and a tenth of one at ten."""
    rest = {F: 0.0, L: 0.0, R: 0.0, Action.BACKWARD: 0.0}
    stay, leave = {**rest, doing: 0.65, other: 0.35}, {**rest, doing: 0.4, other: 0.6}
    for n_ahead in range(1, n_frames + 2):
        votes = [stay] * 4 + [leave] * n_ahead + [stay]
        made = drive_in_context(votes, doing, rate_hz)
        assert (other in made) == (n_ahead >= n_frames)
        assert set(made[: 3 + n_frames]) == {doing}


def test_frames_ahead_with_another_between_them_do_not_add_up():
    stay, leave = {F: 0.65, L: 0.35, R: 0.0}, {F: 0.4, L: 0.6, R: 0.0}
    assert set(drive_in_context([stay, leave, leave] * 20, F, 30)) == {F}


def test_two_moves_that_are_ahead_in_turn_end_a_third():
    """Which side is a guess must not keep a robot from turning."""
    votes = [{F: 0.2, L: 0.5, R: 0.3}, {F: 0.2, L: 0.3, R: 0.5}] * 2
    assert drive_in_context(votes, F, 30)[-1] is not F


def test_a_turn_that_was_not_made_bars_nothing():
    """LEFT was ahead for a frame; then RIGHT is, for long enough."""
    stay, left = {F: 0.65, L: 0.35, R: 0.0}, {F: 0.4, L: 0.6, R: 0.0}
    right = {F: 0.4, L: 0.0, R: 0.6}
    assert drive_in_context([stay, left, stay, right, right, right], F, 30)[-1] is R


@pytest.mark.parametrize("rate_hz", [15, 24, 30, 60])
@pytest.mark.parametrize("other", [L, R])
def test_a_turn_before_a_wall_begins_no_later_than_at_ten_frames_a_second(rate_hz, other):
    """The votes for it rise as the wall comes nearer, as fast as they do in a lesson."""

    def votes(at_s):
        share = min(max(1.5 * at_s, 0.0), 1.0)
        return {F: 1.0 - share, L: 0.0, R: 0.0, other: share}

    def begins_s(rate):
        made = drive_in_context([votes(n / rate) for n in range(rate)], F, rate)
        return made.index(other) / rate

    ahead_s = 0.5 / 1.5
    assert ahead_s - 1 / rate_hz <= begins_s(rate_hz) <= begins_s(10) + 1e-9
    assert begins_s(10) == pytest.approx(0.4)


@pytest.mark.parametrize("rate_hz", [10, 15, 30, 60])
@pytest.mark.parametrize(("doing", "other"), [(F, Action.BACKWARD), (L, F), (Action.BACKWARD, F)])
def test_only_a_turn_on_the_way_straight_has_a_head_start(rate_hz, doing, other):
    behind = {F: 0.0, L: 0.0, R: 0.0, Action.BACKWARD: 0.0, doing: 0.55, other: 0.45}
    assert set(drive_in_context([behind] * rate_hz, doing, rate_hz)) == {doing}


def drive_in_context(votes, doing, rate_hz):
    """Return the move after each frame; a robot that makes it until the next."""
    actions, made, chance = ActionFilter(), [], np.random.default_rng(0)
    for number, shares in enumerate(votes):
        picture = chance.integers(0, 255, (30, 40)).astype(np.uint8)
        view = View(picture=picture, at_s=number / rate_hz, bumped=False)
        doing = actions.choose(
            shares, view, doing, longest_debt_s=2.0, patience_s=0.5, in_context=True
        )
        made.append(doing)
    return made


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


def test_who_drives_into_the_unknown_turns_where_the_votes_are_close():
    """The same votes: FORWARD in known views, the better turn when novelty has risen."""
    actions, votes, chosen = ActionFilter(), {F: 0.6, L: 0.1, R: 0.3}, []
    rng = np.random.default_rng(0)
    for i in range(90):
        picture = rng.integers(0, 255, (30, 40), np.uint8)
        view = View(
            picture=picture, at_s=i / 30, bumped=False, novelty=0.5 if i < 60 else 0.05 * i - 2.5
        )
        chosen.append(
            actions.choose(votes, view, F, longest_debt_s=3.0, patience_s=0.5, in_context=True)
        )
    assert set(chosen[:60]) == {F}
    assert R in chosen[60:]
    assert L not in chosen
