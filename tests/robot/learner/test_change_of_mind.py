"""A label that the pilot gave up gives way; whatever is ordinary teaching changes nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.learner.change_of_mind import ChangeOfMind
from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import RecursiveRidge

FORWARD, LEFT, RIGHT = range(3)
NAMES = ("forward", "left", "right")
SIZE = 12


def note_runs(mind: ChangeOfMind, runs: list[tuple[int, int, int | None]]) -> list[tuple[int, int]]:
    """Return all changes found; a run is its label, its length and what is remembered there."""
    found = []
    for label, length, remembered in runs:
        for _ in range(length):
            old = mind.note(label, remembered)
            if old is not None:
                found.append((old, label))
    return found


def three_labels() -> ChangeOfMind:
    mind = ChangeOfMind()
    for _ in range(3):
        mind.add_label()
    return mind


def turns(*labels: int, remembered: int | None = None) -> list[tuple[int, int, int | None]]:
    """Return runs of turns with driving on between them."""
    return [
        run
        for label in labels
        for run in (
            (FORWARD, 20, FORWARD),
            (label, 15, label if remembered is None else remembered),
        )
    ]


def test_a_side_that_is_left_out_where_it_was_taught_is_given_up() -> None:
    mind = three_labels()
    assert note_runs(mind, turns(*[LEFT] * 6)) == []
    found = note_runs(mind, turns(*[RIGHT] * 3, remembered=LEFT))
    assert set(found) == {(LEFT, RIGHT)}


def test_one_turn_to_the_other_side_gives_nothing_up() -> None:
    mind = three_labels()
    note_runs(mind, turns(*[LEFT] * 6))
    assert note_runs(mind, turns(RIGHT, remembered=LEFT)) == []


def test_other_views_give_nothing_up() -> None:
    mind = three_labels()
    note_runs(mind, turns(*[LEFT] * 6))
    assert note_runs(mind, turns(*[RIGHT] * 9)) == []


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from([LEFT, RIGHT]), min_size=1, max_size=8), st.integers(2, 6))
def test_a_pattern_of_sides_that_repeats_gives_nothing_up(sides: list[int], times: int) -> None:
    """Whatever it is, from the second time on no side is missing for longer than before."""
    mind = three_labels()
    both = [LEFT, *sides, RIGHT]
    for label in both * times:
        assert note_runs(mind, turns(label)) == []
    for label in both * times:
        assert note_runs(mind, turns(label, remembered=LEFT + RIGHT - label)) == []


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(1, 40)), max_size=60))
def test_turning_and_driving_on_never_contradict(lengths: list[tuple[bool, int]]) -> None:
    """Between the two the same view means both, however long each takes."""
    mind = three_labels()
    runs = [
        (label, length, remembered if is_odd else label)
        for is_odd, length in lengths
        for label, remembered in ((FORWARD, LEFT), (LEFT, FORWARD))
    ]
    assert note_runs(mind, runs) == []


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 2), st.integers(1, 9), st.integers(0, 2)), max_size=80),
    st.integers(0, 80),
)
def test_restored_it_goes_on_the_same(runs: list[tuple[int, int, int]], cut: int) -> None:
    whole, first, second = three_labels(), three_labels(), three_labels()
    found = note_runs(first, runs[:cut])
    second.set_arrays(first.get_arrays(), 3)
    assert found + note_runs(second, runs[cut:]) == note_runs(whole, runs)
    one, other = whole.get_arrays(), second.get_arrays()
    assert all(np.array_equal(one[name], other[name]) for name in one)


def lesson(side: str, n_turns: int, seed: int) -> list[tuple[np.ndarray, str]]:
    """Return examples of a drive: a wall comes nearer, then the robot turns; with some noise."""
    rng = np.random.default_rng(seed)
    examples = []
    for turn in range(n_turns):
        near, free = np.zeros(SIZE), np.zeros(SIZE)
        near[turn % 4], free[4 + turn % 4] = 200.0, 200.0
        for label, view in (("forward", free), (side, near)):
            for _ in range(12):
                noisy = np.clip(view + rng.normal(40.0, 12.0, SIZE), 0, 255)
                examples.append((noisy.astype(np.uint8), label))
    return examples


@pytest.mark.parametrize("is_linear", [False, True])
@pytest.mark.parametrize("max_nodes", [8, 32])
def test_it_turns_right_everywhere_after_a_few_turns(max_nodes: int, is_linear: bool) -> None:
    def right_at_walls(forgets: bool) -> float:
        linear = RecursiveRidge(SIZE) if is_linear else None
        learner = BSOCClassifier(max_nodes, linear=linear, forgets=forgets)
        for x, y in [*lesson("left", 16, 1), *lesson("right", 4, 2)]:
            learner.learn_one(x, y)
        walls = [x for x, y in lesson("right", 8, 3) if y == "right"]
        return float(np.mean([learner.predict_one(x) == "right" for x in walls]))

    assert right_at_walls(True) > 0.95
    assert right_at_walls(False) < 0.7


def test_a_pinned_image_keeps_what_it_says() -> None:
    learner = BSOCClassifier(16)
    for x, y in lesson("left", 16, 1):
        learner.learn_one(x, y)
    pinned = [node.id for node in learner.nodes() if max(node.votes, key=node.votes.get) == "left"]
    for node_id in pinned:
        learner.pin_node(node_id)
    before = {node.id: node.votes for node in learner.nodes() if node.id in pinned}
    for x, y in lesson("right", 6, 2):
        learner.learn_one(x, y)
    after = {node.id: dict(node.votes) for node in learner.nodes() if node.id in pinned}
    assert {node: votes["left"] for node, votes in after.items()} == {
        node: votes["left"] for node, votes in before.items()
    }
