"""What a policy learns and refuses, and how its name and its size are chosen."""

from __future__ import annotations

import numpy as np
import pytest

from robot.errors import ConfigurationError
from robot.learner import votes
from robot.moves import Move
from robot.policy import autosize
from robot.policy.registry import full_name, learner_kinds, make_policy, split_name
from robot.types import Action, Point
from tests.kit.frames import frame_of, noisy_blocks
from tests.kit.sizes import crossed
from tests.kit.states import same_state
from tests.learners import installed

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def view(policy, seed, level=0):
    return policy.extract(frame_of(noisy_blocks(seed, level)))


def taught(name, n=40):
    policy = make_policy(name)
    for i in range(n):
        policy.learn(view(policy, i % 6, i), (F, L, R)[i % 3])
    return policy


@pytest.mark.parametrize("name", installed("default-4", "default-32", "published-8", "knn-3"))
def test_the_policy_predicts_what_it_was_taught(name):
    fresh, policy = make_policy(name), taught(name, 60)
    nothing = fresh.propose(7, view(fresh, 0))
    assert (nothing.frame_id, nothing.action, dict(nothing.probabilities)) == (7, None, {})
    x = view(policy, 2, 999)
    prediction = [policy.propose(i, x) for i in range(8)][-1]
    assert prediction.action is R
    assert sum(prediction.probabilities.values()) == pytest.approx(1.0)


def test_a_label_that_is_not_a_move_of_the_body_is_refused():
    policy = make_policy("default-4", moves=(F, L))
    with pytest.raises(ValueError, match="not one of the moves"):
        policy.learn(view(policy, 0), R)
    assert policy.n_seen == 0


@crossed(
    name=installed("default-4", "published-4", "integer-4"),
    bad=[
        *((np.zeros(size, np.uint8), (0.5, 0.5)) for size in (5, 1000, 1199, 3000)),
        *((None, point) for point in ((np.nan, 0.5), (0.0, np.inf), (-1.5, 0.5), (0.0, np.nan))),
    ],
)
def test_a_vector_of_another_length_or_an_invalid_point_teaches_nothing(name, bad):
    policy, loaded, (x, point) = taught(name, 6), make_policy(name), bad
    policy.learn(view(policy, 1), F, 5.0)
    x = view(policy, 2) if x is None else x
    loaded.set_state(policy.get_state())
    for learner in (policy, loaded):
        before = learner.get_state()
        for at_s in (5.01, 9.0):  # 5.01 s is too soon after the last example
            with pytest.raises(ValueError, match=r"values|must lie in"):
                learner.learn(x, F, at_s, Point(*point))
        assert same_state(before, learner.get_state())


def test_confidence_falls_with_novelty_towards_a_guess():
    shares, novelties = [0.9, 0.1, 0.0], (0.0, 1.0, 2.0, 4.0, 1e6)
    confidences = [votes.doubted(shares, 0, 1.6, novelty) for novelty in novelties]
    assert confidences[0] == confidences[1], "a known view does not lose confidence"
    assert confidences[1:] == sorted(set(confidences[1:]), reverse=True)
    assert confidences[-1] == pytest.approx(0.5, abs=1e-3), "one of two taught moves is a guess"


@pytest.mark.parametrize("steering", [-1.0, 1.0, 0.0])
def test_a_body_may_have_more_moves_than_fit_on_a_page(steering):
    moves = tuple(Action(f"move_{i}") for i in range(100))
    policy, again = make_policy("default-4", moves), make_policy("default-4", moves)
    policy.kinds.describe([Move(m, steering=steering, throttle=0.5) for m in moves])
    for i, move in enumerate(moves):
        policy.learn(view(policy, i % 3), move, 0.1 * i)
    again.set_state(policy.get_state())
    again.check()
    assert again.kinds.turns == policy.kinds.turns and again.kinds.straight == policy.kinds.straight


@pytest.mark.parametrize("kind", learner_kinds())
def test_a_learners_full_name_is_made_from_its_kind_or_its_full_name(kind):
    assert full_name(kind, None, 32) == f"{kind}-32"
    assert full_name(f"{kind}-64", None, 32) == f"{kind}-64"
    assert full_name(f"{kind}-64", 16, 32) == f"{kind}-16", "an explicit size has priority"
    assert split_name(full_name(f"{kind}-64", None, 32)) == (kind, 64)


@pytest.mark.parametrize(
    "name", ["", "-", "32", "-32", "default-", "defaul", "default-64-32", "²", "default-1٣"]
)
def test_an_unknown_learner_is_refused_by_the_given_name(name):
    with pytest.raises(ConfigurationError) as refusal:
        make_policy(full_name(name, None, 32))
    assert name in str(refusal.value)


def cost(max_nodes, frame_s):
    return autosize.Cost(max_nodes=max_nodes, extract_s=[0.0], propose_s=[0.0], learn_s=[frame_s])


@pytest.mark.parametrize(("rate_hz", "expected"), [(14, 32), (100, 4), (1, 256)])
def test_the_largest_size_that_sustains_the_rate_with_a_margin_is_chosen(rate_hz, expected):
    asked = []
    chosen = autosize.choose_max_nodes(
        rate_hz, cost_of=lambda size: asked.append(size) or cost(size, size * 1e-3)
    )
    assert chosen.max_nodes == expected
    assert max(asked) == 2 * expected, "the search stops at the first size that is too slow"
    assert chosen.frame_s <= autosize.MARGIN / rate_hz


@pytest.mark.parametrize(
    ("rate_hz", "said"), [(0, "above 0"), (float("nan"), "above 0"), (1e9, "rate")]
)
def test_an_invalid_or_unreachable_rate_is_refused(rate_hz, said):
    with pytest.raises(ConfigurationError, match=said):
        autosize.choose_max_nodes(rate_hz, cost_of=lambda size: cost(size, 1e-3))


def test_a_full_learner_is_measured():
    measured = autosize.measure(8, repeats=20)
    assert measured.max_nodes == 8 and len(measured.learn_s) == 20
    assert min(measured.learn_s) > 0.0


def test_each_measured_step_learns_a_new_view(monkeypatch):
    """A view that was taught before is counted, but not learned again, which takes no time."""
    policy = make_policy("default-4")
    monkeypatch.setattr(autosize, "make_policy", lambda name: policy)
    autosize.measure(4, repeats=100, frames=autosize.sample_frames(10))
    assert policy.learner.cluster.n_trained_ == 104
