from __future__ import annotations

import numpy as np
import pytest

from robot.learner.classifier import BSOCClassifier
from robot.learner.ridge import N_CONTEXTS, ContextRidge, RecursiveRidge

SIZE = 6
ALL = range(N_CONTEXTS)


def make():
    return ContextRidge(SIZE, penalty=2.0, scale=1.0)


@pytest.fixture
def examples():
    rng = np.random.default_rng(0)
    some = [tuple(c for c in ALL if rng.random() < 0.6) for _ in range(60)]
    return list(
        zip(rng.normal(size=(60, SIZE)), rng.integers(0, 3, 60).tolist(), some, strict=True)
    )


def taught(examples):
    ridge = make()
    for _ in range(3):
        ridge.add_label()
    for x, column, contexts in examples:
        ridge.learn(x, np.eye(3)[column], contexts=contexts)
    return ridge


def alone(examples):
    ridge = RecursiveRidge(SIZE, penalty=2.0, scale=1.0)
    for _ in range(3):
        ridge.add_label()
    for x, column, _ in examples:
        ridge.learn(x, np.eye(3)[column])
    return ridge


def opinions(ridge, x):
    return [ridge.scores(x), *(ridge.scores(x, context) for context in ALL)]


@pytest.mark.parametrize("together", [0, 3, 8, 30])
def test_contexts_are_one_until_they_differ(examples, together):
    """The first frames count in all contexts, so it makes no difference that only one ridge learned
    them."""
    mixed = [(x, c, ALL if i < together else (i % 2,)) for i, (x, c, _) in enumerate(examples)]
    ridge = taught(mixed[:together])
    arrays = ridge.save()[1]
    assert not any(name.startswith(("context0", "context1")) for name in arrays)
    again = make()
    again.load({}, arrays)
    for x, column, contexts in mixed[together:]:
        for one in (ridge, again):
            one.learn(x, np.eye(3)[column], contexts=contexts)
    for name, array in ridge.save()[1].items():
        assert np.array_equal(array, again.save()[1][name]), "one that was saved goes on as it was"
    x = examples[2][0]
    for context in ALL:
        own = alone([example for example in mixed if context in example[2]])
        np.testing.assert_allclose(ridge.scores(x, context), own.scores(x), atol=1e-12)


def test_each_context_knows_its_own_examples_and_the_rest_knows_all(examples):
    ridge = taught(examples)
    x = examples[7][0]
    np.testing.assert_array_equal(ridge.scores(x), alone(examples).scores(x))
    for context in ALL:
        own = [example for example in examples if context in example[2]]
        np.testing.assert_allclose(ridge.scores(x, context), alone(own).scores(x), atol=1e-12)


def test_an_example_that_counts_everywhere_is_taken_back_everywhere(examples):
    everywhere = [(x, column, ALL) for x, column, _ in examples]
    ridge = taught(everywhere)
    x, column, _ = everywhere[0]
    ridge.forget(x, np.eye(3)[column], 1.0)
    expected = alone(everywhere[1:])
    for scores in opinions(ridge, x):
        np.testing.assert_allclose(scores, expected.scores(x), atol=1e-5)


def test_each_context_changes_by_its_share_of_the_label(examples):
    """Label 0 becomes label 1; a context that learned half of its frames gets half of the
    change."""
    shares = [0.5, 1.0]
    zeros = [(x, 0, (0, 1) if i % 2 else (1,)) for i, (x, _, _) in enumerate(examples)]
    ridge, x = taught(zeros), examples[3][0]
    before = [ridge.scores(x, context) for context in ALL]
    pure = [alone([e for e in zeros if context in e[2]]) for context in ALL]
    change = np.array([-4.0, 4.0, 0.0])
    ridge.retarget(x, change)
    for context in ALL:
        pure[context].retarget(x, shares[context] * change)
        after = ridge.scores(x, context)
        np.testing.assert_allclose(after, pure[context].scores(x), atol=1e-12)
        assert after[0] < before[context][0]


def test_a_context_without_frames_of_a_label_keeps_its_targets(examples):
    ridge = taught([(x, 0, (1,)) for x, _, _ in examples])
    x = examples[0][0]
    ridge.retarget(x, np.array([-4.0, 4.0, 0.0]))
    ridge.forget(x, np.array([1.0, 0.0, 0.0]), 1.0)
    assert not ridge.scores(x, 0).any()
    assert ridge.scores(x, 1).any()


def test_a_model_of_other_features_is_refused(examples):
    arrays = taught(examples).save()[1]
    other = ContextRidge(SIZE + 1)
    with pytest.raises(ValueError, match=r"the array triangle|does not belong"):
        other.load({}, arrays)


def test_one_view_means_one_thing_to_who_drives_and_another_to_who_turns():
    """Far means FORWARD, near means LEFT; in between the current move goes on."""
    learner = BSOCClassifier(8, linear=ContextRidge(SIZE, penalty=0.01))

    def view(near: float) -> np.ndarray:
        return (255 * np.linspace(near, 1.0 - near, SIZE)).astype(np.uint8)

    for _ in range(20):
        for near in (0.1, 0.3, 0.5, 0.7):
            learner.learn_in(view(near), "forward", (0,))
        learner.learn_in(view(0.8), "left", (0, 1))
        for near in (0.8, 0.6, 0.4):
            learner.learn_in(view(near), "left", (1,))
        learner.learn_in(view(0.2), "forward", (0, 1))
    assert learner.abilities.contexts
    between = view(0.5)
    assert learner.explain_in(between, 0).label == "forward"
    assert learner.explain_in(between, 1).label == "left"
    for context in ALL:
        evidence = learner.explain_in(between, context)
        assert sum(evidence.probabilities.values()) == pytest.approx(1.0)
        assert evidence.node == learner.explain_one(between).node
