"""A view that is labelled anew gives way; whatever is ordinary teaching changes nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.learner.change_of_mind import ChangeOfMind
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import RecursiveRidge

FORWARD, LEFT, RIGHT = range(3)
NODES = 4
HISTOGRAMS = np.array([[9, 0, 0], [0, 9, 0], [0, 9, 0], [0, 0, 9]])
SHARES = np.array([0.2, 0.7, 0.1])
SIZE, ENOUGH = 12, 9


def three_labels() -> ChangeOfMind:
    mind = ChangeOfMind(NODES)
    for _ in range(3):
        mind.add_label()
    return mind


def note(mind: ChangeOfMind, label: int, node: int, times: int = 1) -> None:
    """Teach a label at the view of one image, with driving on before and after it."""
    for _ in range(times):
        for y, place in ((FORWARD, 0), (label, node)):
            distances = np.full(NODES, 9.0)
            distances[place] = 1.0
            mind.note(y, distances, HISTOGRAMS, 2.0)


def shares_at(mind: ChangeOfMind, node: int) -> np.ndarray:
    distances = np.full(NODES, 9.0)
    distances[node] = 1.0
    return mind.applied(SHARES, distances, HISTOGRAMS)


def test_a_view_that_is_labelled_anew_again_and_again_gives_way_there() -> None:
    mind = three_labels()
    note(mind, RIGHT, 1, ENOUGH - 1)
    assert np.array_equal(shares_at(mind, 1), SHARES)
    note(mind, RIGHT, 1)
    shares = shares_at(mind, 1)
    assert shares[RIGHT] > shares[LEFT]
    assert shares.sum() == pytest.approx(1.0)


def test_the_old_label_used_there_once_more_takes_all_back() -> None:
    mind = three_labels()
    note(mind, RIGHT, 1, 3 * ENOUGH)
    note(mind, LEFT, 1)
    assert np.array_equal(shares_at(mind, 1), SHARES)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([FORWARD, LEFT]), st.integers(0, 2)), max_size=200))
def test_turning_and_driving_on_never_contradict(examples: list[tuple[int, int]]) -> None:
    """Between the two the same view means both, however often."""
    mind = three_labels()
    for label, node in [(FORWARD, 0), *examples]:
        note(mind, label, node)
    assert all(np.array_equal(shares_at(mind, node), SHARES) for node in range(NODES))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 3)), max_size=80), st.integers(0, 80))
def test_restored_it_goes_on_the_same(examples: list[tuple[int, int]], cut: int) -> None:
    whole, first, second = three_labels(), three_labels(), three_labels()
    for example in examples[:cut]:
        note(first, *example)
    second.set_arrays(first.get_arrays(), 3)
    for example in examples[cut:]:
        note(second, *example)
    for example in examples:
        note(whole, *example)
    one, other = whole.get_arrays(), second.get_arrays()
    assert all(np.array_equal(one[name], other[name]) for name in one)


def lesson(side: str, n_turns: int, seed: int, first_wall: int = 0) -> list[tuple[np.ndarray, str]]:
    """Return examples of a drive: a wall comes nearer, then the robot turns; with some noise."""
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


@pytest.mark.parametrize("is_linear", [False, True])
@pytest.mark.parametrize("max_nodes", [6, 8])
def test_it_turns_right_at_the_same_walls_after_a_few_turns(
    max_nodes: int, is_linear: bool
) -> None:
    lessons = [*lesson("left", 16, 1), *lesson("right", 8, 2)]
    assert share_of(taught(lessons, max_nodes, is_linear), "right") > 0.95


@pytest.mark.parametrize("is_linear", [False, True])
@pytest.mark.parametrize("n_blocks", [2, 3, 4])
def test_the_other_way_round_at_other_walls_gives_nothing_up(
    n_blocks: int, is_linear: bool
) -> None:
    """Two halves: left at some walls, right at others; neither has to be shown again."""
    lessons = [
        example
        for block in range(n_blocks)
        for example in lesson(("left", "right")[block % 2], 16, block, 4 * (block % 2))
    ]
    follows, keeps = (taught(lessons, 16, is_linear, forgets) for forgets in (True, False))
    for side, first_wall in (("left", 0), ("right", 4)):
        assert share_of(follows, side, first_wall) >= share_of(keeps, side, first_wall)
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
