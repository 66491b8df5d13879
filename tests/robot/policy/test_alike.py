"""The pilot's statement that left and right are alike."""

from __future__ import annotations

import numpy as np
import pytest

from robot.learner.votes import rarity
from robot.policy.changes import can_be_alike, set_alike
from robot.policy.features import GradientFeatures
from robot.policy.history import TrainingHistory
from robot.policy.registry import make_policy
from robot.policy.undo import undo_edit, undo_examples
from robot.types import Action, Example, Point
from server.library.models import begin_like
from tests.kit.frames import frame_of
from tests.kit.states import same_state

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def picture(wall: str, seed: int) -> np.ndarray:
    """A floor with a slanted edge on one side, and a little noise."""
    rows, columns = np.mgrid[0:120, 0:160]
    at = {"left": 60 - rows // 3, "right": 100 + rows // 3, "none": 400}[wall]
    dark = columns < at if wall == "left" else columns > at
    noise = np.random.default_rng(seed).normal(0, 4, (120, 160))
    return np.clip(np.where(dark, 60, 170) + noise, 0, 255).astype(np.uint8)


def one_sided(policy, n: int = 30):
    """A policy that was taught only walls on the left, and therefore only turns to the right."""
    xs = []
    for i in range(n):
        wall, label = ("none", F) if i % 2 else ("left", R)
        xs.append((policy.extract(frame_of(picture(wall, i))), label))
    return xs


def says(policy, wall: str) -> Action:
    policy.reset()
    return policy.propose(1, policy.extract(frame_of(picture(wall, 999)))).action


def test_turning_the_vector_is_turning_the_picture():
    grey = picture("left", 0)
    features = GradientFeatures()
    x, mirrored = (features.extract(frame_of(g)) for g in (grey, grey[:, ::-1]))
    n = features.n_gradients
    turned = x[features.mirror()].astype(float)
    # Samples are at every second pixel, so the result differs in the last bits.
    apart = [np.abs(each - mirrored[:n]).mean() for each in (turned, x[:n].astype(float))]
    assert apart[0] < 0.5 * apart[1]
    np.testing.assert_array_equal(x[features.mirror()][features.mirror()], x[:n])


@pytest.mark.parametrize("first", [True, False])
def test_saying_that_sides_are_alike_teaches_the_other_side_at_any_time(first):
    policy = make_policy("default-8", (F, L, R))
    drive = one_sided(policy)
    if first:
        set_alike(policy, True)
    for x, label in drive:
        policy.learn(x, label)
    assert first or says(policy, "right") is not L
    set_alike(policy, True)
    assert says(policy, "right") is L and says(policy, "left") is R and says(policy, "none") is F


def scores(policy, context=None):
    return [
        policy.learner.linear.scores(policy.extract(frame_of(picture(wall, 77))), context)
        for wall in ("left", "right", "none")
    ]


def test_the_result_is_the_same_before_and_after_the_examples():
    before, after = (make_policy("default-8", (F, L, R)) for _ in range(2))
    set_alike(before, True)
    for policy in (before, after):
        policy.learn(*one_sided(policy)[0], 0.0, Point(0.8, 0.5))
        for i, (x, label) in enumerate(one_sided(policy)):
            policy.learn(x, label, i / 10, Point(0.6 if label is R else 0.0, 0.5))
    set_alike(after, True)
    assert before.learner.labels_ and set(before.learner.labels_) == set(after.learner.labels_)
    order = [after.learner.labels_.index(label) for label in before.learner.labels_]
    for context in (None, 0, 1):
        for one, two in zip(scores(before, context), scores(after, context), strict=True):
            np.testing.assert_allclose(one, two[order], atol=1e-3)
    x = before.extract(frame_of(picture("right", 5)))
    np.testing.assert_allclose(
        before.learner.linear.angle(x), after.learner.linear.angle(x), atol=1e-3
    )
    assert before.learner.linear.angle(x)[0] < 0.0, "it was only ever steered to the right"


def test_withdrawing_the_statement_leaves_no_trace():
    policy, plain = (make_policy("default-8", (F, L, R)) for _ in range(2))
    for one in (policy, plain):
        for x, label in one_sided(one):
            one.learn(x, label)
    set_alike(policy, True)
    set_alike(policy, False)
    for one, two in zip(scores(policy), scores(plain), strict=True):
        np.testing.assert_allclose(one[:2], two, atol=1e-3)


def test_undo_and_replay_are_exact():
    def history():
        return TrainingHistory(make_policy("default-8", (F, L, R)))

    def teach(to, drive, start=0):
        for i, (x, label) in enumerate(drive, start):
            to.teach(Example(frame_id=i, label=label, is_intervention=False), x, i / 10)

    one, two = history(), history()
    drive = one_sided(one.policy)
    for it in (one, two):
        teach(it, drive[:10])
    before = one.policy.get_state()
    one.edit("alike", value=True)
    assert one.policy.alike
    assert undo_edit(one) and not one.policy.alike
    assert same_state(before, one.policy.get_state())
    for it in (one, two):
        it.edit("alike", value=True)
        teach(it, drive[10:20], 10)
    teach(one, drive[20:], 20)
    gone = undo_examples(one, 0.95)
    assert gone and len(gone) == 10
    assert one.policy.alike and same_state(one.policy.get_state(), two.policy.get_state())
    again = make_policy("default-8", (F, L, R))
    again.set_state(one.policy.get_state())
    for policy in (again, one.policy):
        policy.learn(*drive[25])
    assert same_state(again.get_state(), one.policy.get_state())
    again.check()


def test_an_image_that_is_deleted_is_forgotten_in_the_mirror_too():
    policy = make_policy("default-8", (F, L, R))
    set_alike(policy, True)
    for x, label in one_sided(policy, 2):
        policy.learn(x, label)
    for node in policy.learner.nodes():
        policy.learner.delete_node(node.id)
    for each in scores(policy):
        np.testing.assert_allclose(each, 0.0, atol=3e-3)


@pytest.mark.parametrize("name", ["published-8", "knn-3", "integer-8", "without-linear-8"])
def test_a_learner_without_symmetry_refuses_the_statement(name):
    policy = make_policy(name)
    assert not can_be_alike(policy)
    with pytest.raises(ValueError, match="cannot be told"):
        set_alike(policy, True)


def test_moves_without_a_mirror_image_cannot_be_alike():
    assert not can_be_alike(make_policy("default-8", (F, L)))
    assert can_be_alike(make_policy("default-8"))


def test_a_start_from_earlier_models_knows_their_views_and_gives_way():
    earlier = [make_policy("default-32") for _ in range(2)]
    for number, policy in enumerate(earlier):
        for i in range(45):
            wall, label = [("none", F), ("left", R), ("right", L)][(i + number) % 3]
            policy.learn(policy.extract(frame_of(picture(wall, 100 * number + i))), label, i / 10)
    states = [policy.get_state() for policy in earlier]
    fresh, begun = make_policy("default-32"), make_policy("default-32")
    assert begin_like(begun, [*states, make_policy("published-8").get_state()]) == 2
    assert begun.propose(1, begun.extract(frame_of(picture("left", 5)))).action is None
    for policy in (fresh, begun):
        for i in range(8):
            policy.learn(policy.extract(frame_of(picture("none", i))), F, i / 10)
    assert [says(fresh, wall) for wall in ("left", "right")] == [F, F]
    assert [says(begun, wall) for wall in ("none", "left", "right")] == [F, R, L]
    assert begun.n_nodes == fresh.n_nodes

    again = make_policy("default-32")
    again.set_state(begun.get_state())
    for policy in (begun, again):
        for i in range(8, 40):
            wall, label = ("left", L) if i % 2 else ("none", F)
            policy.learn(policy.extract(frame_of(picture(wall, i))), label, i / 10)
    assert says(begun, "left") is L
    arrays, others = begun.get_state().arrays, again.get_state().arrays
    assert all(np.array_equal(arrays[name], others[name]) for name in arrays)
    assert begin_like(begun, states) == 0  # too late: it has examples of its own


def test_a_move_known_only_from_elsewhere_gets_no_votes_for_being_rare():
    unseen, rare, frequent = rarity(np.array([0, 1, 99]), 0.2)
    assert unseen == 1.0 < frequent < rare
