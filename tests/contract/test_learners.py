"""In every learner, the gallery, pinning, novelty and undo either work or are refused."""

from __future__ import annotations

import numpy as np
import pytest

from robot.coaching.gallery import images
from robot.errors import MissingExtraError
from robot.lab.baselines import BASELINES
from robot.lab.variants import VARIANTS
from robot.learner import Learner
from robot.policy.changes import relabel
from robot.policy.example_selection import Repeats
from robot.policy.history import TrainingHistory
from robot.policy.policy import Policy
from robot.policy.registry import learner_kinds, make_policy
from robot.policy.undo import undo_edit, undo_examples
from robot.types import Action, Example, Frame
from tests.kit.frames import frame_of, noisy_blocks
from tests.kit.sizes import few, seeds
from tests.kit.states import same_state

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
SIZE = 6
TAUGHT = 21
"""Number of examples: more than a learner has images, but few, because the lab's networks need
10 ms for each example."""
STEP_S = 0.2


@pytest.fixture(params=sorted({*learner_kinds(), *few(VARIANTS, 3), *BASELINES}))
def kind(request: pytest.FixtureRequest) -> str:
    try:
        make_policy(f"{request.param}-{SIZE}")
    except MissingExtraError as error:
        pytest.skip(f"NOT TESTED: {error}")
    return str(request.param)


def make(kind: str) -> Policy:
    return make_policy(f"{kind}-{SIZE}")


def view(scene: int, noise: int = 0) -> Frame:
    return frame_of(noisy_blocks(scene, noise))


def teach(policy: Policy, examples: int, first: int = 0) -> None:
    for i in range(first, first + examples):
        policy.learn(policy.extract(view(i % 9, i)), MOVES[i % 3])


@pytest.fixture
def each_is_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the policy also learn repeated views, which `Repeats` would skip."""
    monkeypatch.setattr(Repeats, "on_example", lambda self, lesson: None)


@pytest.mark.usefixtures("each_is_learned")
def test_a_learner_of_images_shows_them_all_and_others_show_none(kind: str) -> None:
    policy = make(kind)
    assert isinstance(policy.learner, Learner)
    teach(policy, TAUGHT)
    gallery = images(policy)
    ids = [image.node_id for image in gallery]
    assert bool(gallery) is policy.learner.abilities.images
    assert policy.n_nodes == len(gallery) == len(set(ids))
    if gallery:
        assert sum(image.frames for image in gallery) == TAUGHT
        assert sum(sum(image.votes.values()) for image in gallery) == TAUGHT
        assert max(image.last_taught for image in gallery) == TAUGHT
    node = policy.propose(1, policy.extract(view(3, 500))).node
    used = [image.node_id for image in images(policy) if image.last_used == 1]
    assert used == ([node] if gallery else [])


@pytest.mark.usefixtures("each_is_learned")
def test_images_can_be_edited_or_the_learner_says_that_it_has_none(kind: str) -> None:
    policy = make(kind)
    if not policy.learner.abilities.images:
        for edit in (
            lambda: relabel(policy, 0, MOVES[0]),
            lambda: policy.learner.delete_node(0),
            lambda: policy.learner.pin_node(0),
        ):
            with pytest.raises(ValueError, match="stores no images"):
                edit()
        return
    teach(policy, TAUGHT)
    first, second = (image.node_id for image in images(policy)[:2])
    relabel(policy, first, Action.RIGHT)
    policy.learner.delete_node(second)
    shown = {image.node_id: image for image in images(policy)}
    assert second not in shown
    assert shown[first].votes[Action.RIGHT] == shown[first].frames
    with pytest.raises(LookupError):
        policy.learner.delete_node(10**9)


def test_the_current_move_counts_or_the_learner_says_that_it_does_not(kind: str) -> None:
    """Alternate between two moves each second. The moves begin with different views and end with
    the same view."""
    policy = make(kind)
    for i in range(40):
        move = i // 10 % 2
        scene = 1 if i % 10 > 5 else 2 * move
        policy.learn(policy.extract(view(scene, i % 20)), MOVES[move], 0.1 * i)
    x = policy.extract(view(1, 900))
    votes = [policy.propose(1, x, under_way=move).probabilities for move in MOVES[:2]]
    differs = votes[0] != pytest.approx(votes[1], abs=0.02)
    assert differs is policy.learner.abilities.contexts


def test_a_pinned_image_stays_as_it_is(kind: str) -> None:
    policy = make(kind)
    if not policy.learner.abilities.pinning:
        pytest.skip("this learner cannot pin images")
    teach(policy, TAUGHT)
    pinned = images(policy)[0]
    policy.learner.pin_node(pinned.node_id)
    teach(policy, TAUGHT, first=TAUGHT)
    [still] = [image for image in images(policy) if image.node_id == pinned.node_id]
    assert still.is_pinned
    assert np.array_equal(still.thumbnail, pinned.thumbnail)
    with pytest.raises(ValueError, match="pinned"):
        policy.learner.delete_node(pinned.node_id)


@pytest.mark.usefixtures("each_is_learned")
def test_a_strange_view_is_novel_or_the_learner_says_that_it_cannot_tell(kind: str) -> None:
    policy = make(kind)
    for i in range(60):  # the default learner reports novelty only after 50 examples
        policy.learn(policy.extract(view(0, i)), MOVES[0])
    familiar = policy.propose(1, policy.extract(view(0, 700)))
    strange = policy.propose(2, policy.extract(view(77, 700)))
    assert familiar.novelty < 1.0
    assert (strange.novelty >= 1.0) is policy.learner.abilities.novelty


def test_after_the_last_image_is_deleted_the_policy_proposes_nothing(kind: str) -> None:
    policy = make(kind)
    teach(policy, 6)
    for image in images(policy):
        policy.learner.delete_node(image.node_id)
    prediction = policy.propose(1, policy.extract(view(1)))
    assert (prediction.action is None) is policy.learner.abilities.images


@pytest.mark.parametrize("seed", seeds(1, 3))
def test_undo_leaves_no_trace_of_the_examples(kind: str, seed: int) -> None:
    """Begin new drives in between, at which learners of several places look for their place."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(20, 50))
    drives = set(rng.integers(1, count, 4).tolist())
    scenes = rng.integers(0, 30, count)
    seconds = float(rng.uniform(0.5, 6.0))
    history, untouched = TrainingHistory(make(kind)), TrainingHistory(make(kind))

    def run(history: TrainingHistory, until: int) -> None:
        for i in range(count):
            if i in drives:
                history.begin_drive()
            if i < until:
                x = history.policy.extract(view(int(scenes[i]), i))
                example = Example(frame_id=i, label=MOVES[i % 3], is_intervention=i % 5 == 0)
                history.teach(example, x, captured_s=i * STEP_S)

    run(history, count)
    gone = undo_examples(history, seconds)
    run(untouched, count - len(gone))
    assert gone
    assert same_state(history.policy.get_state(), untouched.policy.get_state())
    for other in (history, untouched):
        teach(other.policy, 15)
    assert same_state(history.policy.get_state(), untouched.policy.get_state())


def test_undoing_an_edit_brings_the_image_back(kind: str) -> None:
    history = TrainingHistory(make(kind))
    if not history.policy.learner.abilities.images:
        pytest.skip("this learner stores no images")
    for i in range(TAUGHT):
        example = Example(frame_id=i, label=MOVES[i % 3], is_intervention=i % 5 == 0)
        history.teach(example, history.policy.extract(view(i % 9, i)), captured_s=i * STEP_S)
    before = history.policy.get_state()
    history.edit("delete", images(history.policy)[0].node_id)
    assert not same_state(history.policy.get_state(), before)
    assert undo_edit(history)
    assert same_state(history.policy.get_state(), before)
