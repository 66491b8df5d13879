"""A relabelled view changes its label, and ordinary teaching changes nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import RecursiveRidge
from robot.learner.votes import ENOUGH, MOST_A_TURN, ChangeOfMind
from tests.kit.sizes import crossed, examples

FORWARD, LEFT, RIGHT = range(3)
OWNERS = np.array([FORWARD, LEFT, LEFT, RIGHT])
SHARES = np.array([0.2, 0.7, 0.1])
SIZE = 12
TURN = 10


class Lesson:
    """Teaches a `ChangeOfMind` turns at four views, each with an image, and driving straight
    between them."""

    def __init__(self) -> None:
        self.mind = ChangeOfMind()
        for _ in range(3):
            self.mind.add_label()
        self.taught = np.zeros(4, np.int64)
        self.now = 0

    def example(self, label: int, view: int) -> None:
        self.mind.note(label, distances_to(view), OWNERS, self.taught, self.now)
        self.now += 1
        if OWNERS[view] == label:
            self.taught[view] = self.now

    def turn(self, label: int, view: int, length: int = TURN) -> None:
        self.example(FORWARD, 0)
        for _ in range(length):
            self.example(label, view)

    def shares_at(self, view: int) -> np.ndarray:
        return self.mind.applied(SHARES, distances_to(view), OWNERS, self.taught)


def distances_to(view: int) -> np.ndarray:
    distances = np.full(4, 9.0)
    distances[view] = 1.0
    return distances


def taught_left() -> Lesson:
    lesson = Lesson()
    for view in (1, 2) * 3:
        lesson.turn(LEFT, view)
    return lesson


def test_a_view_that_is_relabelled_repeatedly_changes_its_label() -> None:
    lesson = taught_left()
    for _ in range(int(ENOUGH / MOST_A_TURN)):
        assert np.array_equal(lesson.shares_at(1), SHARES)
        lesson.turn(RIGHT, 1)
    shares = lesson.shares_at(1)
    assert shares[RIGHT] > shares[LEFT]
    assert shares.sum() == pytest.approx(1.0)


def test_one_turn_of_any_length_does_not_change_a_label() -> None:
    lesson = taught_left()
    lesson.turn(RIGHT, 1, 500)
    assert np.array_equal(lesson.shares_at(1), SHARES)


def test_examples_taught_since_the_change_stay() -> None:
    lesson = taught_left()
    for _ in range(2):
        lesson.turn(RIGHT, 1)
    lesson.turn(LEFT, 2, 1)  # reduces the evidence
    lesson.turn(RIGHT, 1)
    assert lesson.shares_at(1)[RIGHT] > lesson.shares_at(1)[LEFT]
    assert np.array_equal(lesson.shares_at(2), SHARES)


def test_teaching_the_old_label_again_undoes_the_change() -> None:
    lesson = taught_left()
    for _ in range(9):
        lesson.turn(RIGHT, 1)
    lesson.turn(LEFT, 2, 1)
    lesson.turn(LEFT, 1, 1)
    assert np.array_equal(lesson.shares_at(1), SHARES)


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.tuples(st.sampled_from([FORWARD, LEFT]), st.integers(0, 2)), max_size=200))
def test_turning_and_driving_on_never_count_as_a_change_of_mind(
    turns: list[tuple[int, int]],
) -> None:
    """Between a turn and driving straight the same view has both labels, however often it is
    taught."""
    lesson = taught_left()
    for label, view in turns:
        lesson.turn(label, view, 1)
    assert all(np.array_equal(lesson.shares_at(view), SHARES) for view in range(4))


@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.sampled_from([LEFT, RIGHT]), min_size=1, max_size=8), st.integers(1, 6))
def test_turning_to_either_side_alternately_changes_no_label(sides: list[int], times: int) -> None:
    """A pilot without a fixed habit gives the same view one label or the other."""
    lesson = taught_left()
    for side in sides * times:
        for label in (side, LEFT + RIGHT - side):
            lesson.turn(label, 1)
    lesson.turn(LEFT, 1)
    assert lesson.shares_at(1)[LEFT] >= SHARES[LEFT]


def test_later_examples_count_more_than_earlier_ones_of_similar_views() -> None:
    lesson = taught_left()
    for _ in range(20):
        lesson.turn(RIGHT, 3)
    between = np.array([9.0, 1.0, 9.0, 1.0])
    shares = lesson.mind.applied(SHARES, between, OWNERS, lesson.taught)
    assert shares[RIGHT] > shares[LEFT]
    assert shares.sum() == pytest.approx(1.0)


def test_a_pilot_who_announces_the_change_is_followed_from_the_first_turn_on() -> None:
    lesson = taught_left()
    lesson.mind.outdate(lesson.now + 1)
    assert lesson.shares_at(1) == pytest.approx(SHARES), "nothing new was shown"
    lesson.turn(RIGHT, 3)
    assert lesson.shares_at(1)[RIGHT] > lesson.shares_at(1)[LEFT]
    lesson.turn(LEFT, 1)
    assert lesson.shares_at(1)[LEFT] >= SHARES[LEFT], "what is shown anew counts again"
    assert lesson.shares_at(2)[RIGHT] > lesson.shares_at(2)[LEFT], "but not elsewhere"


@settings(max_examples=examples(40), deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 3)), max_size=80), st.integers(0, 80))
def test_restored_it_goes_on_the_same(turns: list[tuple[int, int]], cut: int) -> None:
    whole, other = Lesson(), Lesson()
    for i, turn in enumerate(turns):
        if i == cut:
            other.mind.outdate(other.now + 1)
            whole.mind.outdate(whole.now + 1)
            restored = ChangeOfMind()
            restored.load(*other.mind.save())
            other.mind = restored
        whole.turn(*turn)
        other.turn(*turn)
    (says, ours), (others, theirs) = whole.mind.save(), other.mind.save()
    assert says == others
    assert all(np.array_equal(ours[name], theirs[name]) for name in ours)


def lesson(side: str, n_turns: int, seed: int, first_wall: int = 0) -> list[tuple[np.ndarray, str]]:
    """Return examples of a drive, with some noise: a wall comes nearer, then the robot turns."""
    rng = np.random.default_rng(seed)
    examples = []
    for turn in range(n_turns):
        near, free = np.zeros(SIZE), np.zeros(SIZE)
        near[first_wall + turn % 4], free[8 + turn % 4] = 200.0, 200.0
        for label, view in (("forward", free), (side, near)):
            for _ in range(12):
                noisy = np.clip(view + rng.normal(40.0, 12.0, SIZE), 0, 255)
                examples.append((noisy.astype(np.uint8), label))
    return examples


def taught(
    lessons: list[tuple[np.ndarray, str]], max_nodes: int, is_linear: bool, forgets: bool = True
) -> BSOCClassifier:
    linear = RecursiveRidge(SIZE) if is_linear else None
    learner = BSOCClassifier(max_nodes, linear=linear, forgets=forgets)
    for x, y in lessons:
        learner.learn_one(x, y)
    return learner


def share_of(learner: BSOCClassifier, side: str, first_wall: int = 0) -> float:
    walls = [x for x, y in lesson(side, 8, 3, first_wall) if y == side]
    return float(np.mean([learner.predict_one(x) == side for x in walls]))


@crossed(is_linear=[False, True], max_nodes=[8, 16, 32, 64])
def test_it_turns_right_at_the_same_walls_after_a_few_turns(
    max_nodes: int, is_linear: bool
) -> None:
    lessons = [*lesson("left", 16, 1), *lesson("right", 4, 2)]
    follows, keeps = (taught(lessons, max_nodes, is_linear, forgets) for forgets in (True, False))
    assert share_of(follows, "right") > 0.95
    assert share_of(keeps, "right") < 0.7


@crossed(is_linear=[False, True], max_nodes=[8, 16, 32, 64])
def test_after_an_announced_change_one_wall_teaches_all_walls(
    max_nodes: int, is_linear: bool
) -> None:
    told, untold = (taught(lesson("left", 16, 1), max_nodes, is_linear) for _ in range(2))
    told.outdate()
    with pytest.raises(ValueError, match="new model"):
        BSOCClassifier.published(8).outdate()
    for learner in (told, untold):
        for x, y in lesson("right", 1, 2):
            learner.learn_one(x, y)
    assert share_of(told, "right") > 0.95
    assert share_of(untold, "right") < 0.5


@crossed(is_linear=[False, True], n_blocks=[2, 3, 4], max_nodes=[8, 16, 32, 64])
def test_other_turns_at_other_walls_change_no_label(
    max_nodes: int, n_blocks: int, is_linear: bool
) -> None:
    """Two halves: left at some walls, right at others; neither has to be taught again."""
    lessons = [
        example
        for block in range(n_blocks)
        for example in lesson(("left", "right")[block % 2], 16, block, 4 * (block % 2))
    ]
    follows, keeps = (taught(lessons, max_nodes, is_linear, forgets) for forgets in (True, False))
    for side, first_wall in (("left", 0), ("right", 4)):
        assert share_of(follows, side, first_wall) >= share_of(keeps, side, first_wall)
        if is_linear or max_nodes >= 16:  # eight images are fewer than the views
            assert share_of(follows, side, first_wall) > 0.95


def test_a_pinned_image_keeps_what_it_says() -> None:
    learner = taught(lesson("left", 16, 1), 16, is_linear=False)
    pinned = [node.id for node in learner.nodes() if max(node.votes, key=node.votes.get) == "left"]
    assert pinned
    for node_id in pinned:
        learner.pin_node(node_id)
    before = {node.id: node.votes for node in learner.nodes() if node.id in pinned}
    for x, y in lesson("right", 6, 2):
        learner.learn_one(x, y)
    after = {node.id: dict(node.votes) for node in learner.nodes() if node.id in pinned}
    assert {node: votes["left"] for node, votes in after.items()} == {
        node: votes["left"] for node, votes in before.items()
    }
