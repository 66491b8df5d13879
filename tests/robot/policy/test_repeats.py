from __future__ import annotations

import numpy as np
import pytest

from robot.policy.example_selection import _SETS, _WAYS
from robot.policy.registry import make_policy
from robot.types import Action

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)


def lap(seed: int, n: int = 40) -> list[tuple[np.ndarray, Action]]:
    rng = np.random.default_rng(seed)
    return [(rng.integers(0, 128, 1584).astype(np.uint8), MOVES[i // 5 % 3]) for i in range(n)]


def teach(policy, drive, n_laps=1):
    for _ in range(n_laps):
        for x, label in drive:
            policy.learn(x, label)
        policy.reset()


def learned(policy):
    state = policy.learner.get_state()
    return state.params, {name: array.tobytes() for name, array in state.arrays.items()}


def test_sixty_four_equal_laps_teach_exactly_as_much_as_one():
    once, often = make_policy("default-8"), make_policy("default-8")
    teach(once, lap(0))
    teach(often, lap(0), 64)
    assert learned(once) == learned(often)
    assert often.n_seen == 64 * 40


def test_laps_that_differ_are_all_learned():
    policy = make_policy("default-8")
    for seed in range(5):
        teach(policy, lap(seed))
    assert policy.learner.n_seen_ == 5 * 40


def test_a_contrary_label_is_learned_however_often_the_other_came():
    policy, (x, label) = make_policy("default-8"), lap(0)[0]
    teach(policy, [(x, label)], 30)
    assert policy.learner.n_seen_ == 1
    for n, move in enumerate((Action.LEFT, Action.RIGHT, Action.LEFT)):
        teach(policy, [(x, move)], 3)
        assert policy.learner.n_seen_ == n + 2


def test_its_memory_is_bounded_and_saved():
    policy = make_policy("default-2")
    size = sum(array.nbytes for array in policy.save()[1].values())
    drive = lap(1, 200)
    teach(policy, drive)
    again = make_policy("default-2")
    again.set_state(policy.get_state())
    teach(again, drive)
    assert again.learner.n_seen_ == 200
    assert size >= _SETS * _WAYS * 10
    grown = sum(array.nbytes for array in again.save()[1].values())
    assert grown - size < 10_000


@pytest.mark.parametrize("name", ["published-8", "without-repeats-8", "integer-8", "knn-3"])
def test_other_learners_learn_each_lap(name):
    policy = make_policy(name)
    xs = lap(0)
    if name == "published-8":
        xs = [(x[:1200], label) for x, label in xs]
    if name == "integer-8":
        xs = [(x[:1360], label) for x, label in xs]
    teach(policy, xs, 2)
    assert getattr(policy.learner, "n_seen_", policy.n_seen) == 80
