"""For any votes and any frame rate, the filter makes progress or asks for help."""

from __future__ import annotations

import random

import numpy as np
import pytest

from robot.policy.action_filter import (
    ALLOWANCE,
    ASKING_S,
    HELPLESS_S,
    ActionFilter,
)
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Seen
from robot.policy.pilot_pace import AWAY_S, LONGEST_LOST_S, STUCK_S, TO_AND_FRO_S, PilotPace
from robot.types import Action
from tests.kit.sizes import crossed, seeds
from tests.robot.policy.passing import teach

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
MOVES = (F, L, R)
KINDS = MoveKinds(MOVES)
WHOLE_CIRCLE_S = 19.5
"""Time of a turn about one wheel through 360 degrees (`robot.lab.metrics`)."""


class KnownPace(PilotPace):
    """What is known of the pilot, as a policy would have measured it."""

    patience_s = STUCK_S

    def __init__(self, longest_lost_s: float, patience_s: float) -> None:
        super().__init__(KINDS)
        self.longest_lost_s, self.patience_s = longest_lost_s, patience_s
        for _ in range(20):
            self.scale.add(60.0)  # as two pictures of the wall differ


class Body:
    """A robot that stands at a wall, or not: driving straight has an effect or none."""

    def __init__(self, rate_hz: float, longest_lost_s: float = 4.0, patience_s: float = STUCK_S):
        self.filter = ActionFilter(KINDS)
        self.dt_s = 1 / rate_hz
        self.now_s = 100.0
        self.shift = 0.0
        self.doing: Action | None = Action.STOP
        self.pace = self.filter.pace = KnownPace(longest_lost_s, patience_s)
        self.sent: list[tuple[Action, bool]] = []
        self._rng = np.random.default_rng(1)
        self._wall = self._rng.integers(0, 200, 400, np.uint8)

    def step(self, votes: dict[Action, float], *, is_free: bool = True) -> Action:
        """Let a frame's time pass with the last move, and choose the next."""
        self.now_s += self.dt_s
        if self.doing in KINDS.turns or (self.doing is F and is_free):
            self.shift += 40 * self.dt_s
        at = int(self.shift) % 300
        noise = self._rng.integers(0, 4, (30, 40), np.uint8)
        picture = np.tile(self._wall[at : at + 40], (30, 1)) + noise
        seen = Seen(number=1, x=picture, picture=picture, at_s=self.now_s, under_way=self.doing)
        seen.shares, seen.step_s = votes, self.dt_s
        self.filter.on_frame(seen)
        self.doing = Action.STOP if seen.needs_help else seen.action
        self.sent.append((self.doing, is_free))
        return self.doing

    def run(self, seconds: float, votes, *, is_free: bool = True) -> list[Action]:
        """Continue for a while; `votes` is a dict or a function of the time in seconds."""
        start_s = self.now_s
        return [
            self.step(votes(self.now_s - start_s) if callable(votes) else votes, is_free=is_free)
            for _ in range(round(seconds / self.dt_s))
        ]


def voted(action: Action, share: float = 1.0) -> dict[Action, float]:
    return {move: share if move is action else (1 - share) / 2 for move in MOVES}


@crossed(rate_hz=[5, 10, 15, 30, 60], is_free=[True, False], seed=seeds(4, 12))
def test_no_votes_keep_the_robot_in_one_place_forever(rate_hz, is_free, seed):
    chance = random.Random(f"{seed} {is_free}")
    period_s = 0.05 * 160 ** chance.random()
    pattern = [
        (chance.choice(MOVES), chance.uniform(0.34, 1.0)) for _ in range(chance.randint(1, 6))
    ]
    body = Body(rate_hz)
    body.run(90.0, lambda t: voted(*pattern[int(t / period_s) % len(pattern)]), is_free=is_free)
    idle_s = longest_s = 0.0
    for action, free in body.sent:
        is_way = action is F and free
        idle_s = 0.0 if is_way or action is Action.STOP else idle_s + body.dt_s
        longest_s = max(longest_s, idle_s)
    bound_s = 2 * (2 * ALLOWANCE * body.pace.longest_lost_s + HELPLESS_S + ASKING_S)
    assert longest_s < bound_s
    asked = any(action is Action.STOP for action, _ in body.sent)
    assert asked or is_free, "behind a wall nothing helps but a hand"


@crossed(rate_hz=[5, 10, 15, 30, 60], longest_s=[2.0, 4.0, 6.0])
def test_a_turn_that_the_votes_would_never_end_ends_by_the_pilots_own_measure(rate_hz, longest_s):
    sent = Body(rate_hz, longest_lost_s=longest_s).run(40.0, voted(L, 0.8))
    first_straight_s = sent.index(F) / rate_hz
    assert longest_s * ALLOWANCE < first_straight_s < longest_s * ALLOWANCE * 2.1


@crossed(rate_hz=[5, 10, 15, 30, 60], other=[0.0, 0.2, 0.49])
def test_no_pilots_measure_allows_a_whole_circle(rate_hz, other):
    body = Body(rate_hz, longest_lost_s=LONGEST_LOST_S)
    sent = body.run(30.0, {F: 0.01, L: 0.99 - other, R: other})
    assert sent.index(F) / rate_hz < WHOLE_CIRCLE_S


@crossed(rate_hz=[10, 15, 30], period_s=[0.5, 0.8])
def test_the_robot_does_not_turn_back_and_forth(rate_hz, period_s):
    body = Body(rate_hz)
    sent = body.run(4.0, lambda t: voted(L if t % (2 * period_s) < period_s else R))
    changes = [i for i in range(1, len(sent)) if {sent[i - 1], sent[i]} == {L, R}]
    for first, third in zip(changes, changes[2:], strict=False):
        assert (third - first) / rate_hz > TO_AND_FRO_S - 2 / rate_hz


@crossed(rate_hz=[10, 15, 30], period_s=[0.3, 0.5, 0.8])
def test_the_robot_turns_back_and_forth_only_as_quickly_as_its_pilot(rate_hz, period_s):
    body = Body(rate_hz)
    for frame in range(int(8 * rate_hz)):
        at_s = frame / rate_hz
        label = L if at_s % (2 * period_s) < period_s else R
        teach(body.pace, label, at_s)
    body.pace.longest_lost_s = LONGEST_LOST_S
    assert body.pace.to_and_fro_s < 2 * period_s
    sent = body.run(4.0, lambda t: voted(L if t % (2 * period_s) < period_s else R))
    changes = [i for i in range(1, len(sent)) if {sent[i - 1], sent[i]} == {L, R}]
    assert len(changes) >= 4.0 / period_s - 2
    # Where driving straight has no effect, this would go on until the robot asks.
    body.run(STUCK_S + 0.2, voted(F), is_free=False)
    dither = body.run(1.0, lambda t: voted(L if t % 0.2 < 0.1 else R, 0.6), is_free=False)
    changes = [i for i in range(1, len(dither)) if {dither[i - 1], dither[i]} == {L, R}]
    assert len(changes) <= 2


def test_a_slip_of_the_pilot_does_not_allow_longer_turns():
    pace = PilotPace(KINDS)
    for frame, label in enumerate([*[L] * 8, *[R] * 2, *[L] * 2, *[F] * 40] * 2):
        teach(pace, label, frame / 10)
    assert pace.to_and_fro_s == TO_AND_FRO_S


def test_a_car_steers_from_one_side_to_the_other():
    body = Body(10)
    sent = body.run(3.0, lambda t: voted(L if t < 1.5 else R))
    assert sent[-1] is R
    assert F not in sent


@crossed(rate_hz=[10, 15, 30], share=[0.5, 0.7, 0.9, 0.999])
def test_no_push_is_longer_than_the_pilot_ever_pushed(rate_hz, share):
    body = Body(rate_hz)
    body.run(3.0, voted(F))
    sent = body.run(10.0, voted(F, share), is_free=False)
    longest = max(len(run) for run in "".join("F" if a is F else " " for a in sent).split())
    assert longest / rate_hz <= STUCK_S + 0.4
    assert AWAY_S > STUCK_S


def test_a_robot_that_was_taught_no_other_move_asks_rather_than_push():
    body = Body(10.0)
    body.run(3.0, {F: 1.0, L: 0.0, R: 0.0})
    sent = body.run(3.0, {F: 1.0, L: 0.0, R: 0.0}, is_free=False)
    assert sent.index(Action.STOP) / 10 <= STUCK_S + 0.4


def test_a_robot_whose_pilot_pushes_may_push():
    body = Body(10.0, patience_s=3.0)
    body.run(3.0, voted(F))
    sent = body.run(2.8, voted(F, 0.9), is_free=False)
    assert set(sent) == {F}


def test_without_help_the_robot_tries_again_after_a_while():
    body = Body(10.0)
    sent = body.run(80.0, voted(L), is_free=False)
    asking = [i for i, action in enumerate(sent) if action is Action.STOP]
    assert asking
    after = sent[asking[0] :]
    again = next(i for i, action in enumerate(after) if action is not Action.STOP)
    assert again / 10 == pytest.approx(ASKING_S, abs=0.3)


def test_the_pilots_own_moves_are_not_restricted():
    body = Body(10.0)
    for _ in range(600):
        body.doing = None
        assert body.step(voted(L)) is L
    assert not body.filter.needs_help
    body.doing = None
    body.step(voted(R))
    assert body.step(voted(R)) is R
