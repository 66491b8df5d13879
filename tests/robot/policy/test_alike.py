"""A pilot may say that left and right are alike, and a policy may start from earlier models."""

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
WALLS = ("left", "right", "none")


def picture(wall, seed):
    """A floor with a slanted edge on one side, and a little noise."""
    rows, columns = np.mgrid[0:120, 0:160]
    at = {"left": 60 - rows // 3, "right": 100 + rows // 3, "none": 400}[wall]
    dark = columns < at if wall == "left" else columns > at
    noise = np.random.default_rng(seed).normal(0, 4, (120, 160))
    return np.clip(np.where(dark, 60, 170) + noise, 0, 255).astype(np.uint8)


def view(policy, wall, seed=77):
    return policy.extract(frame_of(picture(wall, seed)))


def one_sided(policy, n=30):
    """Examples of a pilot who meets only walls on the left, and therefore only turns right."""
    walls = [("none", F) if i % 2 else ("left", R) for i in range(n)]
    return [(view(policy, wall, i), label) for i, (wall, label) in enumerate(walls)]


def says(policy, wall):
    policy.reset()
    return policy.propose(1, view(policy, wall, 999)).action


def scores(policy, context=None):
    return [policy.learner.linear.scores(view(policy, wall), context) for wall in WALLS]


@pytest.fixture
def two():
    """Two policies that were taught nothing."""
    return [make_policy("default-8", (F, L, R)) for _ in range(2)]


def test_turning_the_vector_is_turning_the_picture():
    grey, features = picture("left", 0), GradientFeatures()
    x, mirrored = (features.extract(frame_of(g)) for g in (grey, grey[:, ::-1]))
    n = features.n_gradients
    turned = x[features.mirror()].astype(float)
    # The features sample every second pixel, so the results differ in the last bits.
    apart = [np.abs(each - mirrored[:n]).mean() for each in (turned, x[:n].astype(float))]
    assert apart[0] < 0.5 * apart[1]
    np.testing.assert_array_equal(x[features.mirror()][features.mirror()], x[:n])


def test_saying_that_sides_are_alike_teaches_the_other_side_before_and_after_the_examples(two):
    before, after = two
    set_alike(before, True)
    for policy in two:
        policy.learn(*one_sided(policy)[0], 0.0, Point(0.8, 0.5))
        # Each move lasts a second and a half, so each context has examples of its own.
        for i, (x, label) in enumerate(sorted(one_sided(policy), key=lambda lesson: lesson[1])):
            policy.learn(x, label, i / 10, Point(0.6 if label is R else 0.0, 0.5))
    assert says(after, "right") is not L
    for policy in two:
        set_alike(policy, True)
    for policy in two:
        assert [says(policy, wall) for wall in WALLS] == [R, L, F]
    assert set(before.learner.labels_) == set(after.learner.labels_)
    order = [after.learner.labels_.index(label) for label in before.learner.labels_]
    for context in (None, 0, 1):
        for one, other in zip(scores(before, context), scores(after, context), strict=True):
            np.testing.assert_allclose(one, other[order], atol=1e-3)
    angles = [policy.learner.linear.angle(view(policy, "right", 5)) for policy in two]
    np.testing.assert_allclose(*angles, atol=1e-3)
    assert angles[0][0] < 0.0, "the policy steers left, although the pilot only ever turned right"


def test_withdrawing_the_statement_leaves_no_trace(two):
    for policy in two:
        for x, label in one_sided(policy):
            policy.learn(x, label)
    for value in (True, False):
        set_alike(two[0], value)
    for one, other in zip(scores(two[0]), scores(two[1]), strict=True):
        np.testing.assert_allclose(one[:2], other, atol=1e-3)


def test_undo_and_replay_are_exact(two):
    def teach(history, drive, start=0):
        for i, (x, label) in enumerate(drive, start):
            example = Example(frame_id=i, label=label, is_intervention=False)
            history.teach(example, x, i / 10)

    one, other = (TrainingHistory(policy) for policy in two)
    drive = one_sided(one.policy)
    for history in (one, other):
        teach(history, drive[:10])
    before = one.policy.get_state()
    one.edit("alike", value=True)
    assert one.policy.alike
    assert undo_edit(one) and not one.policy.alike
    assert same_state(before, one.policy.get_state())
    for history in (one, other):
        history.edit("alike", value=True)
        teach(history, drive[10:20], 10)
    teach(one, drive[20:], 20)
    assert len(undo_examples(one, 0.95)) == 10
    assert one.policy.alike and same_state(one.policy.get_state(), other.policy.get_state())
    again = make_policy("default-8", (F, L, R))
    again.set_state(one.policy.get_state())
    for policy in (again, one.policy):
        policy.learn(*drive[25])
    assert same_state(again.get_state(), one.policy.get_state())
    again.check()


def test_an_image_that_is_deleted_is_forgotten_in_the_mirror_too(two):
    policy = two[0]
    set_alike(policy, True)
    for x, label in one_sided(policy, 2):
        policy.learn(x, label)
    for node in policy.learner.nodes():
        policy.learner.delete_node(node.id)
    for each in scores(policy):
        np.testing.assert_allclose(each, 0.0, atol=3e-3)


@pytest.mark.parametrize("name", ["published-8", "knn-3", "integer-8", "without-linear-8"])
def test_without_symmetry_the_statement_is_refused(name):
    for policy in (make_policy(name), make_policy("default-8", (F, L))):
        assert not can_be_alike(policy)
        with pytest.raises(ValueError, match="cannot be told"):
            set_alike(policy, True)
    assert can_be_alike(make_policy("default-8"))


def test_a_start_from_earlier_models_knows_their_views_and_gives_way():
    earlier = [make_policy("default-32") for _ in range(2)]
    for number, policy in enumerate(earlier):
        for i in range(45):
            wall, label = [("none", F), ("left", R), ("right", L)][(i + number) % 3]
            policy.learn(view(policy, wall, 100 * number + i), label, i / 10)
    states = [policy.get_state() for policy in earlier]
    fresh, begun = make_policy("default-32"), make_policy("default-32")
    assert begin_like(begun, [*states, make_policy("published-8").get_state()]) == 2
    assert begun.propose(1, view(begun, "left", 5)).action is None
    for policy in (fresh, begun):
        for i in range(8):
            policy.learn(view(policy, "none", i), F, i / 10)
    assert [says(fresh, wall) for wall in WALLS] == [F, F, F]
    assert [says(begun, wall) for wall in WALLS] == [R, L, F]
    assert begun.n_nodes == fresh.n_nodes

    again = make_policy("default-32")
    again.set_state(begun.get_state())
    for policy in (begun, again):
        for i in range(8, 40):
            wall, label = ("left", L) if i % 2 else ("none", F)
            policy.learn(view(policy, wall, i), label, i / 10)
    assert says(begun, "left") is L
    assert same_state(begun.get_state(), again.get_state())
    assert begin_like(begun, states) == 0, "the policy already has examples of its own"


def test_a_move_known_only_from_elsewhere_gets_no_votes_for_being_rare():
    unseen, rare, frequent = rarity(np.array([0, 1, 99]), 0.2)
    assert unseen == 1.0 < frequent < rare
