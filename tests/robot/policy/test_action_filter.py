"""For any votes and frame rate, the robot drives steadily, makes progress, or asks for help."""

from __future__ import annotations

import random

import numpy as np
import pytest

from robot.policy.action_filter import (
    ALLOWANCE,
    ASKING_S,
    HELPLESS_S,
    STRAIGHT_INERTIA,
    TURN_INERTIA,
    VOTES_KEPT,
    ActionFilter,
    RunningVotes,
    StallDetector,
)
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Seen
from robot.policy.pilot_pace import ALTERNATING_S, AWAY_S, LONGEST_LOST_S, STUCK_S, PilotPace
from robot.types import Action, Point
from tests.kit.sizes import crossed, seeds
from tests.robot.policy.passing import see, teach

F, L, R, STOP = Action.FORWARD, Action.LEFT, Action.RIGHT, Action.STOP
BRAKE, GRIP = Action("brake"), Action("grip")
MOVES = (F, L, R)
KINDS = MoveKinds(MOVES)

# Votes ------------------------------------------------------------------------------------------

LITTLE, MUCH = 0.5 + 0.4 * TURN_INERTIA, 0.5 + 0.6 * TURN_INERTIA
BETWEEN = 0.5 + 0.25 * (STRAIGHT_INERTIA + TURN_INERTIA)


@pytest.mark.parametrize(
    ("votes_for_f", "under_way", "in_context", "chosen"),
    [
        (LITTLE, L, False, L),
        (LITTLE, None, False, F),
        (MUCH, L, False, F),
        (BETWEEN, L, False, L),
        (1 - BETWEEN, F, False, L),  # driving straight ends sooner than a turn
        (0.51, L, True, F),  # if the learner has contexts, only the votes decide
        (0.4, STOP, False, L),  # a robot that stands still makes no move
    ],
)
def test_a_move_goes_on_until_another_is_clearly_better(votes_for_f, under_way, in_context, chosen):
    shares = {F: votes_for_f, L: 1 - votes_for_f}
    seen = see(ActionFilter(KINDS), under_way=under_way, shares=shares, in_context=in_context)
    assert seen.action is chosen


def test_proportional_steering_stays_on_the_side_of_the_current_turn():
    """Doubt between left and right must not make the robot steer from lock to lock."""
    steady = ActionFilter(KINDS, 0.0)

    def drive(shares, under_way, point):
        seen = see(steady, under_way=under_way, shares=shares, in_context=True)
        seen.point = point  # like the part after the filter
        return seen.action

    assert drive({F: 0.0, L: 0.4, R: 0.6}, None, Point(0.8, 0.5)) is R
    assert drive({F: 0.0, L: LITTLE, R: 1 - LITTLE}, R, Point(0.8, 0.5)) is R
    assert drive({F: LITTLE, L: 0.0, R: 1 - LITTLE}, R, Point(0.1, 0.5)) is F
    assert drive({F: 0.0, L: 0.4, R: 0.6}, F, Point(0.8, 0.5)) is R
    assert drive({F: 0.0, L: MUCH, R: 1 - MUCH}, R, None) is L
    # if the pilot drives by moves, the votes decide
    assert drive({F: 0.0, L: 1 - LITTLE, R: LITTLE}, L, None) is R


@pytest.mark.parametrize(("usual_run_s", "at_least", "at_most"), [(3.0, 0.3, 0.5), (0.2, 0.0, 0.1)])
def test_the_average_is_no_slower_than_the_pilots_hand(usual_run_s, at_least, at_most):
    votes = RunningVotes(VOTES_KEPT)
    votes.update({F: 1.0, L: 0.0}, 0.1, usual_run_s)
    steady = votes.update({F: 0.0, L: 1.0}, 0.1, usual_run_s)
    assert at_least < steady[F] < at_most


def test_one_odd_frame_does_not_turn_the_average():
    votes, timed = RunningVotes(0.75), RunningVotes(0.75)
    for _ in range(10):
        assert votes.update({F: 1.0, L: 0.0}) == timed.update({F: 1.0, L: 0.0}, 0.1)
    assert votes.update({F: 0.0, L: 1.0})[F] == pytest.approx(0.75)
    votes.reset()
    assert votes.update({F: 0.0, L: 1.0})[L] == 1.0
    for keep in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match="keep must be in"):
            RunningVotes(keep)


# Moves without effect ---------------------------------------------------------------------------


class Drive:
    """Pictures at 20 Hz of a stripe that moves, or that stands still with some noise."""

    def __init__(self):
        kinds = MoveKinds((*MOVES, BRAKE, GRIP))
        self.standstill, self.pace = StallDetector(kinds), PilotPace(kinds)
        self.pace.stands.append(GRIP)
        self.now_s, self.shift = 100.0, 0
        self.rng = np.random.default_rng(3)
        self.go(3, F, is_moving=True)

    @property
    def barred(self):
        return set(self.standstill.futile)

    def go(self, seconds, under_way, is_moving, bumped=False):
        """Drive on; return the time of the first barred move, in seconds after the start."""
        first_s = None
        for i in range(round(seconds * 20)):
            self.shift += is_moving
            picture = np.full((30, 40), 60, np.uint8)
            picture[:, self.shift % 30 : self.shift % 30 + 10] = 180
            picture += self.rng.integers(0, 4, (30, 40), np.uint8)
            self.look(picture, 0.05, under_way, bumped)
            if self.barred and first_s is None:
                first_s = (i + 1) * 0.05
        return first_s

    def look(self, picture, seconds, under_way, bumped=False):
        self.now_s += seconds
        seen = Seen(number=1, x=picture, picture=picture, at_s=self.now_s)
        seen.under_way, seen.bumped = under_way, bumped
        self.standstill.look(seen, self.pace)


@pytest.fixture
def drive():
    """A drive that has gone straight on for three seconds."""
    return Drive()


@pytest.mark.parametrize("bumped", [False, True])
def test_pushing_is_noticed_in_half_a_second(drive, bumped):
    """A pressed bumper shows that the robot is stuck, although the picture slides."""
    assert not drive.barred
    noticed_s = drive.go(3, F, is_moving=bumped, bumped=bumped)
    assert STUCK_S - 0.1 <= noticed_s <= STUCK_S + 0.2
    assert drive.barred == {F}


@pytest.mark.parametrize(
    ("longest_turn_s", "away_s"), [(0.0, AWAY_S), (0.3, STUCK_S), (1.5, 0.9), (8.0, AWAY_S)]
)
def test_the_move_is_free_again_once_the_robot_has_turned_away(drive, longest_turn_s, away_s):
    drive.pace.longest_lost_s = longest_turn_s
    while not drive.barred:
        drive.go(0.05, F, is_moving=False)
    given_up_s = drive.now_s
    while drive.barred:
        drive.go(0.05, L, is_moving=True)
    assert drive.now_s - given_up_s == pytest.approx(away_s, abs=0.15)


def test_a_move_given_up_is_not_taken_up_before_the_picture_moves(drive):
    drive.go(STUCK_S + 0.2, F, is_moving=False)
    drive.go(2 * AWAY_S, L, is_moving=False)
    assert drive.barred == {F}
    for grey in range(60, 100):  # a turn that changes the picture slowly
        drive.look(np.full((30, 40), grey, np.uint8), 0.1, L)
    assert not drive.barred


@pytest.mark.parametrize("under_way", [L, STOP, None, GRIP])
def test_turning_standing_and_gripping_on_purpose_do_not_count_as_pushing(drive, under_way):
    assert drive.go(5, under_way, is_moving=False) is None


def test_a_move_that_does_not_help_is_given_up_too_until_all_are_tried_again(drive):
    assert drive.go(5, BRAKE, is_moving=True, bumped=True) is None, "the effect is still unknown"
    for move in (BRAKE, F):
        before = drive.barred
        drive.go(STUCK_S - 0.2, move, is_moving=False)
        assert drive.barred == before
        drive.go(0.4, move, is_moving=False)
        assert drive.barred == before | {move}
    drive.standstill.lift()
    assert drive.go(0.1, F, is_moving=False) is None


def test_a_flash_of_light_does_not_make_all_after_it_look_still(drive):
    drive.look(np.full((30, 40), 255, np.uint8), 0.1, F)
    assert drive.go(3, F, is_moving=True) is None


# Ways out ---------------------------------------------------------------------------------------


class Body:
    """A robot, perhaps at a wall, where driving straight has no effect."""

    def __init__(self, rate_hz=10.0, longest_lost_s=4.0, push_s=0.0):
        self.filter = ActionFilter(KINDS)
        self.dt_s, self.now_s, self.shift = 1 / rate_hz, 100.0, 0.0
        self.doing = STOP
        self.pace = self.filter.pace  # the change that the policy would measure
        self.pace.longest_lost_s, self.pace._pushes_s = longest_lost_s, [push_s] * 3
        for _ in range(20):
            self.pace.scale.add(60.0)  # two pictures of the wall differ by this much
        self._rng = np.random.default_rng(1)
        self._wall = self._rng.integers(0, 200, 400, np.uint8)

    def step(self, votes, *, is_free=True):
        """Let the time of one frame pass with the last move, and choose the next move."""
        self.now_s += self.dt_s
        if self.doing in KINDS.turns or (self.doing is F and is_free):
            self.shift += 40 * self.dt_s
        at = int(self.shift) % 300
        noise = self._rng.integers(0, 4, (30, 40), np.uint8)
        picture = np.tile(self._wall[at : at + 40], (30, 1)) + noise
        known = {"picture": picture, "at_s": self.now_s, "step_s": self.dt_s, "shares": votes}
        seen = see(self.filter, under_way=self.doing, **known)
        self.doing = STOP if seen.needs_help else seen.action
        return self.doing

    def run(self, seconds, votes, *, is_free=True):
        """Return the moves within some time; `votes` is a dict, or a function of the time in
        seconds."""
        start_s = self.now_s
        return [
            self.step(votes(self.now_s - start_s) if callable(votes) else votes, is_free=is_free)
            for _ in range(round(seconds / self.dt_s))
        ]


def voted(action, share=1.0):
    return {move: share if move is action else (1 - share) / 2 for move in MOVES}


def alternating(period_s, share=1.0):
    return lambda t: voted(L if t % (2 * period_s) < period_s else R, share)


def changes_of_side(sent):
    return [i for i in range(1, len(sent)) if {sent[i - 1], sent[i]} == {L, R}]


@crossed(rate_hz=[5, 10, 15, 30, 60], is_free=[True, False], seed=seeds(3, 12))
def test_no_votes_keep_the_robot_in_one_place_forever(rate_hz, is_free, seed):
    chance = random.Random(f"{seed} {is_free}")
    period_s = 0.05 * 160 ** chance.random()
    pattern = [
        (chance.choice(MOVES), chance.uniform(0.34, 1.0)) for _ in range(chance.randint(1, 6))
    ]
    body, idle_s, longest_s = Body(rate_hz), 0.0, 0.0
    sent = body.run(
        90.0, lambda t: voted(*pattern[int(t / period_s) % len(pattern)]), is_free=is_free
    )
    for action in sent:
        idle_s = 0.0 if (action is F and is_free) or action is STOP else idle_s + body.dt_s
        longest_s = max(longest_s, idle_s)
    assert longest_s < 2 * (2 * ALLOWANCE * body.pace.longest_lost_s + HELPLESS_S + ASKING_S)
    assert STOP in sent or is_free, "behind a wall only a person can help"


@crossed(rate_hz=[5, 10, 15, 30, 60], longest_s=[2.0, 4.0, 6.0])
def test_a_turn_that_the_votes_would_never_end_ends_after_the_pilots_own_longest_turn(
    rate_hz, longest_s
):
    sent = Body(rate_hz, longest_lost_s=longest_s).run(40.0, voted(L, 0.8))
    first_straight_s = sent.index(F) / rate_hz
    assert longest_s * ALLOWANCE < first_straight_s < longest_s * ALLOWANCE * 2.1


@crossed(rate_hz=[5, 10, 15, 30, 60], other=[0.0, 0.2, 0.49])
def test_no_pilots_measure_allows_a_whole_circle(rate_hz, other):
    whole_circle_s = 19.5  # a turn about one wheel by 360 degrees (`robot.lab.metrics`)
    body = Body(rate_hz, longest_lost_s=LONGEST_LOST_S)
    sent = body.run(30.0, {F: 0.01, L: 0.99 - other, R: other})
    assert sent.index(F) / rate_hz < whole_circle_s


@crossed(rate_hz=[10, 15, 30], period_s=[0.3, 0.5, 0.8])
def test_the_robot_turns_back_and_forth_only_as_quickly_as_its_pilot(rate_hz, period_s):
    sent = Body(rate_hz).run(4.0, alternating(period_s))
    changes = changes_of_side(sent)
    for first, third in zip(changes, changes[2:], strict=False):
        assert (third - first) / rate_hz > ALTERNATING_S - 2 / rate_hz
    body, hand = Body(rate_hz), alternating(period_s)
    for frame in range(int(8 * rate_hz)):
        votes = hand(frame / rate_hz)
        teach(body.pace, max(votes, key=votes.get), frame / rate_hz)
    body.pace.longest_lost_s = LONGEST_LOST_S
    assert body.pace.alternating_s < 2 * period_s
    assert len(changes_of_side(body.run(4.0, hand))) >= 4.0 / period_s - 2
    # If driving straight has no effect, the robot alternates until it asks for help.
    body.run(STUCK_S + 0.2, voted(F), is_free=False)
    assert len(changes_of_side(body.run(1.0, alternating(0.1, 0.6), is_free=False))) <= 2


def test_a_slip_of_the_pilot_does_not_allow_longer_turns():
    pace = PilotPace(KINDS)
    for frame, label in enumerate([*[L] * 8, *[R] * 2, *[L] * 2, *[F] * 40] * 2):
        teach(pace, label, frame / 10)
    assert pace.alternating_s == ALTERNATING_S


def test_a_car_steers_from_one_side_to_the_other():
    sent = Body().run(3.0, alternating(1.5))
    assert sent[-1] is R
    assert F not in sent


@crossed(rate_hz=[10, 15, 30], share=[0.5, 0.7, 0.9, 0.999])
def test_no_push_is_longer_than_the_pilot_ever_pushed(rate_hz, share):
    body = Body(rate_hz)
    body.run(3.0, voted(F))
    sent = body.run(10.0, voted(F, share), is_free=False)
    longest = max(len(run) for run in "".join("F" if a is F else " " for a in sent).split())
    assert longest / rate_hz <= STUCK_S + 0.4
    pusher = Body(rate_hz, push_s=2.0)
    pusher.run(3.0, voted(F))
    assert set(pusher.run(2.8, voted(F, 0.9), is_free=False)) == {F}


def test_a_robot_that_was_taught_no_other_move_asks_rather_than_push():
    body = Body()
    body.run(3.0, {F: 1.0, L: 0.0, R: 0.0})
    sent = body.run(3.0, {F: 1.0, L: 0.0, R: 0.0}, is_free=False)
    assert sent.index(STOP) / 10 <= STUCK_S + 0.4


def test_without_help_the_robot_tries_again_after_a_while():
    sent = Body().run(80.0, voted(L), is_free=False)
    asked = sent[sent.index(STOP) :]
    again = next(i for i, action in enumerate(asked) if action is not STOP)
    assert again / 10 == pytest.approx(ASKING_S, abs=0.3)


def test_the_pilots_own_moves_are_not_restricted():
    body = Body()
    for _ in range(600):
        body.doing = None
        assert body.step(voted(L)) is L
    assert not body.filter.needs_help
    body.doing = None
    body.step(voted(R))
    assert body.step(voted(R)) is R
