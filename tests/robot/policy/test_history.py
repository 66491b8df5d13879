"""Teaching, and taking lessons back as if they had never been."""

from __future__ import annotations

import numpy as np
import pytest

from robot.learner.base import State
from robot.policy.history import Edited, School, SchoolEvent, Taught, Undone
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.types import Action, Lesson
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
STEP_S = 0.1
LEARNERS = ("published-8", "default-8")


def vectors(policy: Policy, count: int) -> list[np.ndarray]:
    camera = BenchRobot().camera
    return [policy.extract(camera.show(scene)) for scene in range(count)]


def teach(school: School, xs: list[np.ndarray], first: int = 0) -> None:
    for i, x in enumerate(xs, start=first):
        lesson = Lesson(frame_id=i, label=MOVES[i % 3], is_intervention=False)
        school.teach(lesson, x, captured_s=i * STEP_S)


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
    school = School(make_policy(learner))
    xs = vectors(school.policy, 450)
    teach(school, xs)
    gone = school.undo(seconds)
    assert len(gone) == round(seconds / STEP_S)

    untouched = School(make_policy(learner))
    teach(untouched, xs[: len(xs) - len(gone)])
    assert same(school.policy.get_state(), untouched.policy.get_state())
    assert school.taught == untouched.taught

    teach(school, xs[:20], first=500)
    teach(untouched, xs[:20], first=500)
    assert same(school.policy.get_state(), untouched.policy.get_state())


def test_undo_can_be_repeated_back_to_the_beginning() -> None:
    school = School(make_policy("published-8"))
    fresh = school.policy.get_state()
    teach(school, vectors(school.policy, 120))
    assert len(school.undo(5.0)) == 50
    assert len(school.undo(5.0)) == 50
    assert len(school.undo(30.0)) == 20
    assert same(school.policy.get_state(), fresh)
    assert school.lessons == 0
    assert school.undo(5.0) == []


def test_undo_counts_teaching_time_not_pauses() -> None:
    school = School(make_policy("published-8"))
    xs = vectors(school.policy, 20)
    teach(school, xs[:10])
    teach(school, xs[10:], first=10_000)
    assert len(school.undo(1.45)) == 10 + 1


def test_the_log_stays_small_however_long_one_teaches() -> None:
    school = School(make_policy("published-4"))
    xs = vectors(school.policy, 10)
    for round_ in range(200):
        teach(school, xs, first=round_ * 10)
    assert len(school.last_lessons(1e9)) <= 10 * (35 + 10 + 10) / STEP_S / 10
    assert school.lessons == 2000


def test_an_edit_is_undone_alone_and_lessons_stay() -> None:
    school = School(make_policy("published-8"))
    teach(school, vectors(school.policy, 30))
    before = school.policy.get_state()
    node = school.policy.gallery()[0]
    wrong = min(MOVES, key=lambda move: node.votes.get(move, 0))
    school.edit("relabel", node.node_id, wrong)
    assert not same(school.policy.get_state(), before)
    assert school.undo_edit()
    assert same(school.policy.get_state(), before)
    assert not school.undo_edit()


def test_undoing_lessons_keeps_the_edits_made_meanwhile() -> None:
    school = School(make_policy("published-8"))
    xs = vectors(school.policy, 40)
    teach(school, xs[:8])
    node = school.policy.gallery()[0]
    school.edit("relabel", node.node_id, Action.RIGHT)
    with_edit = school.policy.get_state()
    teach(school, xs[8:12], first=8)
    assert len(school.undo(0.35)) == 4
    assert same(school.policy.get_state(), with_edit)


def test_a_bad_edit_is_refused_and_changes_nothing() -> None:
    school = School(make_policy("published-8"))
    teach(school, vectors(school.policy, 8))
    before = school.policy.get_state()
    with pytest.raises(LookupError):
        school.edit("delete", 10_000)
    with pytest.raises(ValueError, match="paint"):
        school.edit("paint", school.policy.gallery()[0].node_id)
    assert same(school.policy.get_state(), before)


def test_everything_that_changes_the_learner_is_told_in_order() -> None:
    told: list[SchoolEvent] = []
    school = School(make_policy("published-8"), told.append)
    teach(school, vectors(school.policy, 3))
    school.edit("pin", school.policy.gallery()[0].node_id, True)
    school.undo(0.05)
    kinds = [type(event) for event in told]
    assert kinds == [Taught, Taught, Taught, Edited, Undone]
    assert told[-1] == Undone(frame_ids=(2,))
