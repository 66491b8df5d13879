from __future__ import annotations

import random

import numpy as np
import pytest

from robot.coaching.gallery import images
from robot.errors import ConfigurationError
from robot.learner import votes
from robot.moves import Move
from robot.policy.registry import full_name, learner_kinds, make_policy, split_name
from robot.types import Action, Point
from tests.kit.frames import frame_of, noisy_blocks
from tests.kit.sizes import crossed
from tests.learners import installed

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def view(seed, level=0):
    return frame_of(noisy_blocks(seed, level))


def taught(name, n=40):
    policy = make_policy(name)
    for i in range(n):
        seed = i % 6
        policy.learn(policy.extract(view(seed, i)), (F, L, R)[seed % 3])
    return policy


@pytest.mark.parametrize("name", installed("default-4", "default-32", "published-8", "knn-3"))
def test_the_policy_predicts_what_it_was_taught(name):
    policy = taught(name, 60)
    x = policy.extract(view(2, 999))
    prediction = [policy.propose(i, x) for i in range(8)][-1]
    assert prediction.action is R
    assert sum(prediction.probabilities.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("rate_hz", [11.0, 30.0])
def test_an_unsteady_camera_of_any_rate_teaches_ten_examples_a_second(rate_hz):
    policy, dice = make_policy("default-64"), random.Random(0)
    n_frames = round(4.0 * rate_hz)
    for i in range(n_frames):
        at_s = (i + dice.uniform(-0.1, 0.1)) / rate_hz
        policy.learn(policy.extract(view(i)), F, at_s)
    assert policy.n_seen == n_frames
    assert policy.n_nodes == pytest.approx(40, abs=1), "each learned view is an image of its own"


def test_the_policy_proposes_nothing_before_the_first_example():
    policy = make_policy("default-8")
    prediction = policy.propose(7, policy.extract(view(0)))
    assert (prediction.frame_id, prediction.action, dict(prediction.probabilities)) == (7, None, {})


@pytest.mark.parametrize("name", installed("knn-3", "mlp-4"))
def test_a_policy_from_a_saved_state_predicts_and_learns_the_same(name):
    first, second = taught(name), make_policy(name)
    second.set_state(first.get_state())
    first.reset()
    for i in range(20):
        x = first.extract(view(i % 6, 500 + i))
        assert first.propose(i, x) == second.propose(i, x)
        first.learn(x, F)
        second.learn(x, F)
    assert [g.votes for g in images(first)] == [g.votes for g in images(second)]


def test_a_label_that_is_not_a_move_of_the_body_is_refused():
    policy = make_policy("default-4", moves=(F, L))
    with pytest.raises(ValueError, match="not one of the moves"):
        policy.learn(policy.extract(view(0)), R)
    assert policy.n_seen == 0


def unlike(one, other):
    """Return the names of the values and arrays that differ between two states."""
    arrays = one.arrays.keys() | other.arrays.keys()
    params = [] if one.params == other.params else ["params"]
    return params + [n for n in arrays if not np.array_equal(one.arrays[n], other.arrays[n])]


@crossed(
    name=installed("default-4", "published-4", "integer-4"),
    bad=[
        *((np.zeros(size, np.uint8), (0.5, 0.5)) for size in (5, 1000, 1199, 3000)),
        *((None, point) for point in ((np.nan, 0.5), (0.0, np.inf), (-1.5, 0.5), (0.0, np.nan))),
    ],
)
def test_a_vector_of_another_length_or_a_point_that_is_none_teaches_nothing(name, bad):
    policy, (x, point) = taught(name, 6), bad
    policy.learn(policy.extract(view(1)), F, 5.0)
    x = policy.extract(view(2)) if x is None else x
    loaded = make_policy(name)
    loaded.set_state(policy.get_state())
    for learner in (policy, loaded):
        before = learner.get_state()
        for at_s in (5.01, 9.0):  # the first is only counted
            with pytest.raises(ValueError, match=r"values|must lie in"):
                learner.learn(x, F, at_s, Point(*point))
        assert unlike(before, learner.get_state()) == []


def test_confidence_falls_with_novelty_towards_a_guess():
    shares, novelties = [0.9, 0.1, 0.0], (0.0, 1.0, 2.0, 4.0, 1e6)
    confidences = [votes.doubted(shares, 0, 1.6, novelty) for novelty in novelties]
    assert confidences[0] == confidences[1], "the known is not doubted"
    assert confidences[1:] == sorted(set(confidences[1:]), reverse=True)
    assert confidences[-1] == pytest.approx(0.5, abs=1e-3), "a guess between the moves taught"


@pytest.mark.parametrize(("steering", "throttle"), [(-1.0, 0.5), (1.0, 0.5), (0.0, 0.5)])
def test_a_body_may_have_more_moves_than_fit_on_a_page(steering, throttle):
    moves = tuple(Action(f"move_{i}") for i in range(100))
    policy, again = make_policy("default-4", moves), make_policy("default-4", moves)
    policy.kinds.describe([Move(m, steering=steering, throttle=throttle) for m in moves])
    for i, move in enumerate(moves):
        policy.learn(policy.extract(view(i % 3)), move, 0.1 * i)
    again.set_state(policy.get_state())
    again.check()
    assert again.kinds.turns == policy.kinds.turns and again.kinds.straight == policy.kinds.straight


@pytest.mark.parametrize("kind", learner_kinds())
def test_a_learners_full_name_is_made_from_its_kind_or_its_full_name(kind: str) -> None:
    assert full_name(kind, None, 32) == f"{kind}-32"
    assert full_name(f"{kind}-64", None, 32) == f"{kind}-64"
    assert full_name(f"{kind}-64", 16, 32) == f"{kind}-16", "what is asked for counts"
    assert split_name(full_name(f"{kind}-64", None, 32)) == (kind, 64)


@pytest.mark.parametrize(
    "name", ["", "-", "32", "-32", "default-", "defaul", "default-64-32", "²", "default-1٣"]
)
def test_an_unknown_learner_is_refused_by_the_given_name(name: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        make_policy(full_name(name, None, 32))
    assert name in str(refusal.value)
