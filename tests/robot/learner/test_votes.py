"""Which views are novel, and when a pilot has changed their mind."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.learner.bsoc import BSOC
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import RecursiveRidge
from robot.learner.votes import ENOUGH, HELD_OUT, MOST_A_TURN, ChangeOfMind, Novelty, percentile
from tests.kit.sizes import crossed, examples, few

# Novelty ----------------------------------------------------------------------------------------


def filled(lengths, **options):
    novelty = Novelty(**options)
    for length in lengths:
        novelty.learn(length**2)
    return novelty


def test_the_median_is_0_and_about_one_in_fifty_is_1_whatever_the_scale():
    lengths = np.random.default_rng(0).gamma(3.0, 1.0, 600)
    for scale in (0.01, 1.0, 1000.0):
        novelty = filled(scale * lengths)
        scores = np.array([novelty.score((scale * length) ** 2) for length in lengths])
        assert np.median(scores) == pytest.approx(0.0, abs=0.02)
        assert (scores >= 1.0).mean() == pytest.approx(0.018, abs=0.008)
        assert novelty.score((10 * scale * lengths.max()) ** 2) > 3


def test_a_wider_margin_moves_the_border_by_a_share_of_the_median():
    lengths = [1.0 + i % 600 / 599 for i in range(630)]
    usual, wide = filled(lengths), filled(lengths, margin=0.55)
    border = 1.98 + 0.05 * 1.5
    assert usual.score(border**2) == pytest.approx(1.0, abs=1e-6)
    assert wide.score((border + 0.5 * 1.5) ** 2) == pytest.approx(1.0, abs=1e-6)


def test_novelty_is_zero_after_few_examples_and_forgets_old_distances():
    assert filled([1.0, 2.0, 3.0]).score(1e6) == 0.0
    novelty = filled([1.0 + 0.01 * (i % 10) for i in range(600)])
    assert novelty.score(9.0) > 1
    for i in range(600):
        novelty.learn((5.0 + 0.1 * (i % 10)) ** 2)
    assert novelty.score(9.0) == 0.0


@pytest.mark.parametrize("repeats", [1, 3])
def test_neighbouring_frames_do_not_count_as_familiar(repeats):
    """A slow pan: each frame is near the previous one, and far from all earlier frames."""
    cluster = BSOC(64)
    held, plain = [], []
    for i in range(200):
        x = np.zeros(400, np.float32)
        x[2 * i // repeats : 2 * i // repeats + 40] = 1.0
        if cluster.n_nodes_ > 1:
            plain.append(cluster.lookup(x)[1])
        cluster.train(x)
        if i > 2 * HELD_OUT and cluster.last_distance_ is not None:
            held.append(cluster.last_distance_)
    assert min(held) > 2 * np.median(plain)


@given(st.lists(st.floats(0.0, 1e6), min_size=2, max_size=700), st.sampled_from([50, 98]))
def test_percentiles_equal_those_of_numpy(values, share):
    assert percentile(sorted(values), share) == float(np.percentile(values, share))


# A change of mind at single views ---------------------------------------------------------------

FORWARD, LEFT, RIGHT = range(3)
OWNERS = np.array([FORWARD, LEFT, LEFT, RIGHT])
SHARES = np.array([0.2, 0.7, 0.1])


class Lesson:
    """Teaches turns at four views, each with an image, and driving straight between them.

    Each of the two views of LEFT was already taught three times.
    """

    def __init__(self):
        self.mind = ChangeOfMind()
        for _ in range(3):
            self.mind.add_label()
        self.taught = np.zeros(4, np.int64)
        self.now = 0
        for view in (1, 2) * 3:
            self.turn(LEFT, view)

    def example(self, label, view):
        self.mind.note(label, distances_to(view), OWNERS, self.taught, self.now)
        self.now += 1
        if OWNERS[view] == label:
            self.taught[view] = self.now

    def turn(self, label, view, length=10):
        self.example(FORWARD, 0)
        for _ in range(length):
            self.example(label, view)

    def shares_at(self, *views):
        shares = self.mind.applied(SHARES, distances_to(*views), OWNERS, self.taught)
        assert shares.sum() == pytest.approx(1.0)
        return shares

    def is_unchanged_at(self, view):
        return np.array_equal(self.shares_at(view), SHARES)

    def says_right_at(self, *views):
        shares = self.shares_at(*views)
        return shares[RIGHT] > shares[LEFT]


def distances_to(*views):
    distances = np.full(4, 9.0)
    distances[[*views]] = 1.0
    return distances


@pytest.fixture
def lesson():
    return Lesson()


def test_a_view_that_is_relabelled_repeatedly_changes_its_label(lesson):
    for _ in range(int(ENOUGH / MOST_A_TURN)):
        assert lesson.is_unchanged_at(1)
        lesson.turn(RIGHT, 1)
    assert lesson.says_right_at(1)


def test_one_turn_of_any_length_does_not_change_a_label(lesson):
    lesson.turn(RIGHT, 1, 500)
    assert lesson.is_unchanged_at(1)


def test_examples_taught_since_the_change_stay(lesson):
    for _ in range(2):
        lesson.turn(RIGHT, 1)
    lesson.turn(LEFT, 2, 1)  # this reduces the evidence
    lesson.turn(RIGHT, 1)
    assert lesson.says_right_at(1) and lesson.is_unchanged_at(2)


def test_teaching_the_old_label_again_undoes_the_change(lesson):
    for _ in range(9):
        lesson.turn(RIGHT, 1)
    lesson.turn(LEFT, 2, 1)
    lesson.turn(LEFT, 1, 1)
    assert lesson.is_unchanged_at(1)


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.tuples(st.sampled_from([FORWARD, LEFT]), st.integers(0, 2)), max_size=200))
def test_turning_and_driving_on_never_count_as_a_change_of_mind(turns):
    """At the border between a turn and driving straight, a view has both labels, however often it
    is taught."""
    lesson = Lesson()
    for label, view in turns:
        lesson.turn(label, view, 1)
    assert all(lesson.is_unchanged_at(view) for view in range(4))


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.sampled_from([LEFT, RIGHT]), min_size=1, max_size=8), st.integers(1, 6))
def test_turning_to_either_side_alternately_changes_no_label(sides, times):
    """A pilot without a fixed habit gives the same view one label or the other."""
    lesson = Lesson()
    for side in sides * times:
        for label in (side, LEFT + RIGHT - side):
            lesson.turn(label, 1)
    lesson.turn(LEFT, 1)
    assert lesson.shares_at(1)[LEFT] >= SHARES[LEFT]


def test_later_examples_count_more_than_earlier_ones_of_similar_views(lesson):
    for _ in range(20):
        lesson.turn(RIGHT, 3)
    assert lesson.says_right_at(1, 3)


def test_a_pilot_who_announces_the_change_is_followed_from_the_first_turn_on(lesson):
    lesson.mind.outdate(lesson.now + 1)
    assert lesson.shares_at(1) == pytest.approx(SHARES), "nothing new has been taught yet"
    lesson.turn(RIGHT, 3)
    assert lesson.says_right_at(1)
    lesson.turn(LEFT, 1)
    assert lesson.shares_at(1)[LEFT] >= SHARES[LEFT], "examples after the change count again"
    assert lesson.says_right_at(2), "other views do not change"


# A change of mind of a classifier ---------------------------------------------------------------

SIZE = 12


def drive(side, n_turns, seed, first_wall=0):
    """Return examples of a drive, with some noise: a wall comes nearer, then the robot turns."""
    rng = np.random.default_rng(seed)
    lessons = []
    for turn in range(n_turns):
        near, free = np.zeros(SIZE), np.zeros(SIZE)
        near[first_wall + turn % 4], free[8 + turn % 4] = 200.0, 200.0
        for label, view in (("forward", free), (side, near)):
            for _ in range(12):
                noisy = np.clip(view + rng.normal(40.0, 12.0, SIZE), 0, 255)
                lessons.append((noisy.astype(np.uint8), label))
    return lessons


def taught(lessons, max_nodes, *, is_linear=False, forgets=True):
    linear = RecursiveRidge(SIZE) if is_linear else None
    return teach(BSOCClassifier(max_nodes, linear=linear, forgets=forgets), lessons)


def teach(learner, lessons):
    for x, y in lessons:
        learner.learn_one(x, y)
    return learner


def share_of(learner, side, first_wall=0):
    walls = [x for x, y in drive(side, 8, 3, first_wall) if y == side]
    return np.mean([learner.predict_one(x) == side for x in walls])


LEARNERS = crossed(is_linear=[False, True], max_nodes=[8, 16, 32, 64])


@LEARNERS
def test_the_robot_turns_right_at_the_same_walls_after_a_few_turns(max_nodes, is_linear):
    lessons = [*drive("left", 16, 1), *drive("right", 4, 2)]
    shares = [
        share_of(taught(lessons, max_nodes, is_linear=is_linear, forgets=forgets), "right")
        for forgets in (True, False)
    ]
    assert shares[0] > 0.95 and shares[1] < 0.7


@LEARNERS
def test_after_an_announced_change_one_wall_teaches_all_walls(max_nodes, is_linear):
    told, untold = (taught(drive("left", 16, 1), max_nodes, is_linear=is_linear) for _ in "12")
    told.outdate()
    for learner in (told, untold):
        teach(learner, drive("right", 1, 2))
    assert share_of(told, "right") > 0.95 and share_of(untold, "right") < 0.5
    with pytest.raises(ValueError, match="new model"):
        BSOCClassifier.published(8).outdate()


@crossed(is_linear=[False, True], n_blocks=few([2, 3, 4], 2), max_nodes=few([8, 16, 32, 64], 2))
def test_other_turns_at_other_walls_change_no_label(max_nodes, n_blocks, is_linear):
    """The pilot turns left at some walls and right at others, and teaches each wall once."""
    lessons = []
    for block in range(n_blocks):
        lessons += drive(("left", "right")[block % 2], 16, block, 4 * (block % 2))
    follows, keeps = (
        taught(lessons, max_nodes, is_linear=is_linear, forgets=forgets)
        for forgets in (True, False)
    )
    for side, first_wall in (("left", 0), ("right", 4)):
        share = share_of(follows, side, first_wall)
        assert share >= share_of(keeps, side, first_wall)
        assert share > 0.95 or (max_nodes == 8 and not is_linear), "there are more views than nodes"
