from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.policy.calibration import CHANGE_S, Calibration
from robot.policy.registry import make_policy
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
MOVES = (F, L, R)
USUAL = pytest.approx(1.0, abs=1e-6)


class Lesson:
    """Examples in runs of one label, and a learner that is right at changes as often as told."""

    def __init__(self, right_at_changes: float, share: float = 0.7, step_s: float = 0.1):
        self.calibration = Calibration()
        self.right, self.share, self.step_s = right_at_changes, share, step_s
        self.rng = np.random.default_rng(5)
        self.now_s, self.asked = 0.0, 0

    def votes(self, label):
        self.asked += 1
        said = label if self.rng.random() < self.right else MOVES[MOVES.index(label) - 1]
        rest = (1.0 - self.share) / 2
        return {move: self.share if move is said else rest for move in MOVES}

    def drive(self, label, seconds, pause_s=0.0):
        self.now_s += pause_s
        for _ in range(round(seconds / self.step_s)):
            self.now_s += self.step_s
            self.calibration.note(label, self.now_s, lambda: self.votes(label))
        return self

    def turns(self, n_turns, seconds=2.0):
        for _ in range(n_turns):
            self.drive(F, seconds).drive(L, seconds)
        return self


def test_it_grows_surer_the_better_the_changes_are_foreseen():
    factors = [Lesson(right).turns(40).calibration.factor for right in (0.2, 0.5, 0.8, 1.0)]
    assert factors == sorted(factors)
    assert factors[0] < 0.9 and factors[-1] > 1.1


def test_before_the_first_change_it_is_as_usual():
    lesson = Lesson(0.0).drive(F, 30.0)
    assert lesson.asked == 0
    assert lesson.calibration.factor == USUAL


@pytest.mark.parametrize("run_s", [1.0, 4.0, 16.0])
def test_only_what_follows_a_change_counts(run_s):
    lesson = Lesson(1.0).turns(20, run_s)
    n_changes = 39
    assert lesson.asked == pytest.approx(n_changes * CHANGE_S / 0.1, abs=1)


def test_where_a_correction_begins_says_nothing():
    lesson = Lesson(0.0)
    for label in (F, L, R) * 10:
        lesson.drive(label, 3.0, pause_s=0.5)
    assert lesson.calibration.factor == USUAL


def test_a_move_that_is_new_says_nothing():
    calibration = Calibration()
    for label, at_s in ((F, 0.1), (R, 0.2), (R, 0.3)):
        calibration.note(label, at_s, lambda: {F: 0.9, L: 0.1})
    assert calibration.factor == USUAL


labels = st.lists(st.tuples(st.sampled_from(MOVES), st.floats(0.05, 0.6)), max_size=60)


@given(before=labels, after=labels)
def test_a_restored_calibration_goes_on_the_same_and_its_bounds_hold(before, after):
    rng = np.random.default_rng(len(before))

    def votes():
        shares = rng.random(3)
        return dict(zip(MOVES, (shares / shares.sum()).tolist(), strict=True))

    one, two, now_s = Calibration(), Calibration(), 0.0
    for label, step_s in before:
        now_s += step_s
        one.note(label, now_s, votes)
    two.load(json.loads(json.dumps(one.save()[0])), {}, {str(move): move for move in MOVES})
    for label, step_s in after:
        now_s += step_s
        said = votes()
        one.note(label, now_s, lambda said=said: said)
        two.note(label, now_s, lambda said=said: said)
    assert one.save() == two.save() and one.factor == two.factor
    assert 0.5**0.4 <= one.factor <= 4.0**0.4


@pytest.mark.parametrize("harm", [{"losses": [0.0]}, {"losses": [float("nan")] * 13}])
def test_a_state_that_is_none_is_refused(harm):
    with pytest.raises(ValueError, match="losses"):
        Calibration().load(Calibration().save()[0] | harm, {})


def views(n_runs):
    rng = np.random.default_rng(1)
    centres = rng.integers(0, 256, (3, 1584))
    for run in range(n_runs):
        label = MOVES[run % 3]
        for _ in range(8):
            noisy = centres[run % 3] + rng.normal(0.0, 60.0, 1584)
            yield noisy.clip(0, 255).astype(np.uint8), label


def test_confidence_follows_and_the_vote_does_not():
    sure, usual = make_policy("default-8"), make_policy("without-calibration-8")
    for policy in (sure, usual):
        for number, (x, label) in enumerate(views(30)):
            policy.learn(x, label, 0.1 * number)
    mixed = next(x // 2 + y // 2 for x, _ in views(1) for y, label in views(2) if label is L)
    one, other = (policy.propose(1, mixed, at_s=9.0) for policy in (sure, usual))
    assert one.probabilities == other.probabilities and one.action is other.action
    assert one.confidence > other.confidence  # it foresaw every change of move


def test_it_is_saved_with_the_model():
    policy, copy = make_policy("default-8"), make_policy("default-8")
    for number, (x, label) in enumerate(views(20)):
        policy.learn(x, label, 0.1 * number)
    copy.restore(policy.get_state())
    x = next(views(1))[0]
    assert copy.propose(1, x).confidence == policy.propose(1, x).confidence
    assert copy.get_state().params["calibration"] == policy.get_state().params["calibration"]
