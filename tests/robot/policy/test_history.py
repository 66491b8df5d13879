"""Teaching, and taking lessons back as if they had never been."""

from __future__ import annotations

import numpy as np
import pytest

from robot.learner.base import State
from robot.policy.history import Edited, HistoryEvent, Taught, TrainingHistory, Undone
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.types import Action, Example
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
STEP_S = 0.1
LEARNERS = ("published-8", "default-8")


def vectors(policy: Policy, count: int) -> list[np.ndarray]:
    camera = BenchRobot().camera
    return [policy.extract(camera.show(scene)) for scene in range(count)]


def teach(history: TrainingHistory, xs: list[np.ndarray], first: int = 0) -> None:
    for i, x in enumerate(xs, start=first):
        example = Example(frame_id=i, label=MOVES[i % 3], is_intervention=False)
        history.teach(example, x, captured_s=i * STEP_S)


def same(a: State, b: State) -> bool:
    return (
        a.kind == b.kind
        and a.labels == b.labels
        and a.arrays.keys() == b.arrays.keys()
        and all(np.array_equal(a.arrays[key], b.arrays[key]) for key in a.arrays)
    )


@pytest.mark.parametrize("learner", LEARNERS)
@pytest.mark.parametrize("seconds", [0.5, 5.0, 30.0])
def test_undo_leaves_the_learner_as_if_the_lessons_had_never_been(
    learner: str, seconds: float
) -> None:
    history = TrainingHistory(make_policy(learner))
    xs = vectors(history.policy, 450)
    teach(history, xs)
    gone = history.undo(seconds)
    assert len(gone) == round(seconds / STEP_S)

    untouched = TrainingHistory(make_policy(learner))
    teach(untouched, xs[: len(xs) - len(gone)])
    assert same(history.policy.get_state(), untouched.policy.get_state())
    assert history.taught == untouched.taught

    teach(history, xs[:20], first=500)
    teach(untouched, xs[:20], first=500)
    assert same(history.policy.get_state(), untouched.policy.get_state())


def test_undo_can_be_repeated_back_to_the_beginning() -> None:
    history = TrainingHistory(make_policy("published-8"))
    fresh = history.policy.get_state()
    teach(history, vectors(history.policy, 120))
    assert len(history.undo(5.0)) == 50
    assert len(history.undo(5.0)) == 50
    assert len(history.undo(30.0)) == 20
    assert same(history.policy.get_state(), fresh)
    assert history.n_examples == 0
    assert history.undo(5.0) == []


def test_undo_counts_teaching_time_not_pauses() -> None:
    history = TrainingHistory(make_policy("published-8"))
    xs = vectors(history.policy, 20)
    teach(history, xs[:10])
    teach(history, xs[10:], first=10_000)
    assert len(history.undo(1.45)) == 10 + 1


def test_the_log_stays_small_however_long_one_teaches() -> None:
    history = TrainingHistory(make_policy("published-4"))
    xs = vectors(history.policy, 10)
    for round_ in range(200):
        teach(history, xs, first=round_ * 10)
    assert len(history.last_examples(1e9)) <= 10 * (35 + 10 + 10) / STEP_S / 10
    assert history.n_examples == 2000


def test_an_edit_is_undone_alone_and_lessons_stay() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 30))
    before = history.policy.get_state()
    node = history.policy.gallery()[0]
    wrong = min(MOVES, key=lambda move: node.votes.get(move, 0))
    history.edit("relabel", node.node_id, wrong)
    assert not same(history.policy.get_state(), before)
    assert history.undo_edit()
    assert same(history.policy.get_state(), before)
    assert not history.undo_edit()


def test_undoing_lessons_keeps_the_edits_made_meanwhile() -> None:
    history = TrainingHistory(make_policy("published-8"))
    xs = vectors(history.policy, 40)
    teach(history, xs[:8])
    node = history.policy.gallery()[0]
    history.edit("relabel", node.node_id, Action.RIGHT)
    with_edit = history.policy.get_state()
    teach(history, xs[8:12], first=8)
    assert len(history.undo(0.35)) == 4
    assert same(history.policy.get_state(), with_edit)


def test_a_bad_edit_is_refused_and_changes_nothing() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 8))
    before = history.policy.get_state()
    with pytest.raises(LookupError):
        history.edit("delete", 10_000)
    with pytest.raises(ValueError, match="paint"):
        history.edit("paint", history.policy.gallery()[0].node_id)
    assert same(history.policy.get_state(), before)


def test_everything_that_changes_the_learner_is_told_in_order() -> None:
    told: list[HistoryEvent] = []
    history = TrainingHistory(make_policy("published-8"), told.append)
    teach(history, vectors(history.policy, 3))
    history.edit("pin", history.policy.gallery()[0].node_id, True)
    history.undo(0.05)
    kinds = [type(event) for event in told]
    assert kinds == [Taught, Taught, Taught, Edited, Undone]
    assert told[-1] == Undone(frame_ids=(2,))
