"""Teaching, and undoing examples as if they had never been taught."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from robot.coaching.gallery import LearnedImage, images
from robot.moves import Move
from robot.policy.changes import replay
from robot.policy.events import Edited, HistoryEvent, LogEvent, Replaced, Taught, Undone
from robot.policy.history import TrainingHistory
from robot.policy.part import PolicyPart, TaughtExample
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.policy.undo import last_examples, undo_edit, undo_examples
from robot.store.models.model import same_nodes
from robot.types import Action, Example, Point
from tests.kit.sizes import crossed, few
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
STEP_S = 0.1
LEARNERS = ("published-8", "default-8")


def vectors(policy: Policy, count: int) -> list[np.ndarray]:
    camera = BenchRobot().camera
    return [policy.extract(camera.show(scene)) for scene in range(count)]


def teach(history: TrainingHistory, xs: list[np.ndarray], first: int = 0) -> None:
    for i, x in enumerate(xs, start=first):
        example = Example(frame_id=i, label=MOVES[i % 3], is_intervention=i % 5 == 0)
        history.teach(example, x, captured_s=i * STEP_S)


@pytest.mark.parametrize("learner", ["published-8", "default-8", "integer-8"])
def test_examples_taught_in_batches_leave_the_same_learner_bit_for_bit(learner: str) -> None:
    """Batches of 1 to 5, at thirty frames a second, with pauses, points, turns and an undo."""
    one, many = (TrainingHistory(make_policy(learner)) for _ in range(2))
    random, at_s, lessons = np.random.default_rng(7), 0.0, []
    for i, x in enumerate(3 * vectors(one.policy, 50)):
        at_s += 2.0 if i % 40 == 39 else 1 / 30
        label = MOVES[i // 13 % 3]
        point = Point(0.1 * (i % 7), 0.5) if i > 70 else None
        example = Example(frame_id=i, label=label, is_intervention=i % 5 == 0, point=point)
        lessons.append((example, x, at_s))
    while lessons:
        size = random.integers(1, 6)
        batch, lessons = lessons[:size], lessons[size:]
        told = many.teach_all(batch)
        for example, x, captured_s in batch:
            one.teach(example, x, captured_s)
        assert [event.at_s for event in told][-1] == one.teaching_s == many.teaching_s
    for seconds in (0.0, 1.3):
        assert [e.frame_id for e in undo_examples(one, seconds)] == [
            e.frame_id for e in undo_examples(many, seconds)
        ]
        here, there = one.policy.get_state(), many.policy.get_state()
        assert here.params == there.params and here.arrays.keys() == there.arrays.keys()
        for name, array in here.arrays.items():
            np.testing.assert_array_equal(array, there.arrays[name])


def test_undo_can_be_repeated_back_to_the_beginning() -> None:
    history = TrainingHistory(make_policy("published-8"))
    fresh = history.policy.get_state()
    teach(history, vectors(history.policy, 120))
    assert len(undo_examples(history, 5.0)) == 50
    assert len(undo_examples(history, 5.0)) == 50
    assert len(undo_examples(history, 30.0)) == 20
    assert same_nodes(history.policy.get_state(), fresh)
    assert history.taught.total() == 0
    assert undo_examples(history, 5.0) == []


def test_undo_counts_teaching_time_not_pauses() -> None:
    history = TrainingHistory(make_policy("published-8"))
    xs = vectors(history.policy, 20)
    teach(history, xs[:10])
    teach(history, xs[10:], first=10_000)
    assert len(undo_examples(history, 1.45)) == 10 + 1


def test_the_log_stays_small_however_long_one_teaches() -> None:
    history = TrainingHistory(make_policy("published-4"))
    xs = vectors(history.policy, 10)
    for round_ in range(200):
        teach(history, xs, first=round_ * 10)
    assert len(last_examples(history, 1e9)) <= 10 * (35 + 10 + 10) / STEP_S / 10
    assert history.taught.total() == 2000


def test_undoing_an_edit_keeps_the_examples() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 30))
    before = history.policy.get_state()
    node = images(history.policy)[0]
    wrong = min(MOVES, key=lambda move: node.votes.get(move, 0))
    history.edit("relabel", node.node_id, wrong)
    assert not same_nodes(history.policy.get_state(), before)
    assert undo_edit(history)
    assert same_nodes(history.policy.get_state(), before)
    assert not undo_edit(history)


def test_declaring_earlier_examples_outdated_is_an_edit() -> None:
    history = TrainingHistory(make_policy("default-8"))
    xs = vectors(history.policy, 30)
    teach(history, xs[:20])

    def outdated_before() -> int:
        params: dict[str, Any] = history.policy.get_state().params["learner"]
        return int(params["outdated_before"])

    assert outdated_before() == 0
    history.edit("outdate")
    assert outdated_before() > 0
    teach(history, xs[20:], first=20)
    undo_examples(history, 0.25)
    assert outdated_before() > 0, "it stays when lessons are undone"
    assert undo_edit(history)
    assert outdated_before() == 0


def test_only_the_last_edit_is_taken_back() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 30))
    first, second = images(history.policy)[:2]
    history.edit("pin", first.node_id, True)
    history.edit("pin", second.node_id, True)
    assert undo_edit(history)
    pinned = [image.node_id for image in images(history.policy) if image.is_pinned]
    assert pinned == [first.node_id]


def test_undoing_lessons_keeps_the_edits_made_meanwhile() -> None:
    history = TrainingHistory(make_policy("published-8"))
    xs = vectors(history.policy, 40)
    teach(history, xs[:8])
    node = images(history.policy)[0]
    history.edit("relabel", node.node_id, Action.RIGHT)
    with_edit = history.policy.get_state()
    teach(history, xs[8:12], first=8)
    assert len(undo_examples(history, 0.35)) == 4
    assert same_nodes(history.policy.get_state(), with_edit)


def test_a_bad_edit_is_refused_and_changes_nothing() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 8))
    before = history.policy.get_state()
    with pytest.raises(LookupError):
        history.edit("delete", 10_000)
    with pytest.raises(ValueError, match="paint"):
        history.edit("paint", images(history.policy)[0].node_id)
    assert same_nodes(history.policy.get_state(), before)


N_PARTS = len(make_policy("default-8")._learning)


class Plugin(PolicyPart):
    """Refuses the given calls after the parts before it have learned."""

    def __init__(self, policy: Policy, done: int) -> None:
        self.refuses = False
        self.error: Exception = RuntimeError("not today")
        policy._learning.insert(done, self)
        theirs = type("Theirs", (type(policy.learner),), {"__module__": "somebodys.plugin"})
        policy.learner.__class__ = theirs

    def on_example(self, lesson: TaughtExample) -> None:
        if self.refuses:
            raise self.error


@pytest.mark.parametrize("done", few(range(N_PARTS + 1), 3))
def test_an_example_that_a_plugin_refuses_leaves_no_trace_and_undo_is_exact(done: int) -> None:
    policy, untouched = make_policy("default-8"), TrainingHistory(make_policy("default-8"))
    plugin, history = Plugin(policy, done), TrainingHistory(policy)
    assert history.batch == 1, "a plugin may refuse an example"
    for number, x in enumerate(5 * vectors(policy, 26)):
        example = Example(frame_id=number, label=MOVES[number // 20 % 3], is_intervention=False)
        plugin.refuses = number in {5, 6, 28, 110, 125}
        if plugin.refuses:
            example = replace(example, point=Point(-0.3, 0.3))
            with pytest.raises(RuntimeError):
                history.teach(example, x, number * STEP_S)
        else:
            history.teach(example, x, number * STEP_S)
            untouched.teach(example, x, number * STEP_S)
    for seconds in (0.0, 0.45, 3.0, 30.0):
        gone = [example.frame_id for example in undo_examples(history, seconds)]
        assert gone == [example.frame_id for example in undo_examples(untouched, seconds)]
        here, there = history.policy.get_state(), untouched.policy.get_state()
        assert same_nodes(here, there)
        assert here.params == there.params
        assert (history.taught, history.teaching_s) == (untouched.taught, untouched.teaching_s)


@pytest.mark.parametrize("error", [RuntimeError("not today"), ValueError("not today")])
def test_if_a_plugin_refuses_to_learn_again_nothing_is_undone(error: Exception) -> None:
    policy = make_policy("default-8")
    plugin, history = Plugin(policy, 3), TrainingHistory(policy)
    teach(history, vectors(policy, 26))
    history.edit("outdate")
    before, plugin.refuses, plugin.error = policy.get_state(), True, error
    for undo in (lambda: undo_examples(history, 0.45), lambda: undo_edit(history)):
        with pytest.raises(type(error)):
            undo()
        assert same_nodes(policy.get_state(), before)
        assert policy.get_state().params == before.params
        assert history.taught.total() == 26
    plugin.refuses = False
    assert len(undo_examples(history, 0.45)) == 5
    assert undo_edit(history)


def teach_at(history: TrainingHistory, *times_s: float) -> None:
    """Teach one example at each of these teaching times, to the last digit."""
    xs = vectors(history.policy, 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("robot.policy.history._LONGEST_STEP_S", math.inf)
        for number, at_s in enumerate(times_s):
            example = Example(frame_id=number, label=MOVES[number % 3], is_intervention=False)
            history.teach(example, xs[number % 3], at_s)


def test_an_undo_learns_again_only_what_came_after_the_snapshot_before_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach_at(history, *(step * 0.5 for step in range(22)))  # a snapshot at 10.0, the last at 10.5
    learned_s: list[float] = []
    learn = history.policy.learn

    def listen(x: np.ndarray, label: Action, at_s: float, point: None) -> None:
        learned_s.append(at_s)
        learn(x, label, at_s)

    monkeypatch.setattr(history.policy, "learn", listen)
    assert [example.frame_id for example in undo_examples(history, 0.5)] == [21]
    assert learned_s == []
    assert [example.frame_id for example in undo_examples(history, 0.5)] == [20]
    assert learned_s == [step * 0.5 for step in range(20)]


def test_the_learner_is_copied_every_ten_seconds_and_not_more_often() -> None:
    policy = make_policy("published-8")
    x = vectors(policy, 1)[0]
    with mock.patch.object(policy, "get_state", wraps=policy.get_state) as copied:
        history = TrainingHistory(policy)
        teach(history, [x] * 311)
    assert copied.call_count == 1 + 3


@pytest.mark.parametrize(("last_s", "n_undone", "n_kept"), [(46.5, 4, 5), (47.0, 3, 3)])
def test_the_log_keeps_no_more_snapshots_than_an_undo_of_35_seconds_needs(
    last_s: float, n_undone: int, n_kept: int
) -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach_at(history, 0.0, 12.0, 24.0, 36.0, last_s)
    assert len(last_examples(history, 35.0)) == sum(
        at_s > last_s - 35.0 for at_s in (12, 24, 36, 47)
    )
    assert len(undo_examples(history, 1e9)) == n_kept
    assert history.taught.total() == 5 - n_kept


def test_an_undo_is_as_exact_after_the_log_was_shortened() -> None:
    times_s = [step * 0.5 for step in range(121)]
    history, untouched = (TrainingHistory(make_policy("published-8")) for _ in range(2))
    teach_at(history, *times_s)
    assert len(last_examples(history, 1e9)) < len(times_s)
    assert len(undo_examples(history, 2.0)) == 4
    teach_at(untouched, *times_s[:-4])
    assert same_nodes(history.policy.get_state(), untouched.policy.get_state())


def test_teaching_time_begins_at_zero_and_undo_turns_it_back() -> None:
    told: list[HistoryEvent] = []
    history = TrainingHistory(make_policy("published-8"), told.extend)
    xs = vectors(history.policy, 3)
    teach(history, xs[:2], first=100)
    undo_examples(history, 5.0)
    teach(history, xs[2:], first=102)
    times_s = [event.at_s for event in told if isinstance(event, Taught)]
    assert times_s == pytest.approx([0.0, STEP_S, STEP_S])


def test_each_change_is_counted_and_reported_once() -> None:
    told: list[HistoryEvent] = []
    history = TrainingHistory(make_policy("published-8"), told.extend)
    assert history.changes == 0
    teach(history, vectors(history.policy, 3))
    history.edit("pin", images(history.policy)[0].node_id, True)
    undo_examples(history, 0.05)
    undo_edit(history)
    history.replace_policy(make_policy("published-4"))
    assert [type(event) for event in told[:-3]] == [Taught, Taught, Taught, Edited]
    assert told[-3:-1] == [Undone(frame_ids=(2,)), Undone(frame_ids=())]
    assert told[-1] == Replaced(policy_name="published-4")
    assert history.changes == len(told)
    assert history.edits == len(told) - 3, "all but the examples"


def test_an_exchanged_policy_keeps_its_training_which_cannot_be_undone() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 3))
    loaded = make_policy("published-4")
    history.replace_policy(loaded, Counter({Action.FORWARD: 5}))
    assert (history.policy, history.taught.total()) == (loaded, 5)
    assert undo_examples(history, 30.0) == []
    before = loaded.get_state()
    teach(history, vectors(loaded, 2), first=3)
    assert history.taught.total() == 7
    assert len(undo_examples(history, 30.0)) == 2
    assert same_nodes(loaded.get_state(), before)
    assert history.taught == {Action.FORWARD: 5}
    history.replace_policy(make_policy("published-4"))
    assert history.taught.total() == 0


def test_each_edit_does_what_it_says() -> None:
    history = TrainingHistory(make_policy("published-8"))
    teach(history, vectors(history.policy, 6))
    first, second, *_ = (node.node_id for node in images(history.policy))

    def node(node_id: int) -> LearnedImage:
        return next(node for node in images(history.policy) if node.node_id == node_id)

    history.edit("relabel", first, Action.RIGHT)
    assert {move for move, votes in node(first).votes.items() if votes} == {Action.RIGHT}
    for is_pinned in (True, False):
        history.edit("pin", first, is_pinned)
        assert node(first).is_pinned is is_pinned
    history.edit("delete", second)
    assert second not in {node.node_id for node in images(history.policy)}


def test_a_drive_counts_only_if_something_was_taught_in_it() -> None:
    history = TrainingHistory(make_policy("published-8"))
    xs = vectors(history.policy, 2)
    counted = []
    for step in (None, xs[:1], None, None, xs[1:], None):
        if step is None:
            history.begin_drive()
        else:
            teach(history, step)
        counted.append(history.drives)
    assert counted == [0, 0, 1, 1, 1, 2]


def test_a_learner_begins_each_drive_again_after_an_undo() -> None:
    history = TrainingHistory(make_policy("default-8"))
    by_hand = make_policy("default-8")
    xs = vectors(by_hand, 60)
    for first in (0, 30):
        teach(history, xs[first : first + 30], first=first)
        for event in last_examples(history, 29.5 * STEP_S):
            example = event.example
            by_hand.learn(event.x, example.label, event.at_s)
        if first == 0:
            history.begin_drive()
            by_hand.reset()
    assert same_nodes(history.policy.get_state(), by_hand.get_state())
    teach(history, xs[:5], first=60)
    assert len(undo_examples(history, 5 * STEP_S)) == 5
    assert same_nodes(history.policy.get_state(), by_hand.get_state())


def test_a_drive_begins_with_a_reset_policy_also_when_it_is_learned_again() -> None:
    history = TrainingHistory(make_policy("published-8"))
    xs = vectors(history.policy, 20)
    teach(history, xs[:10])
    with mock.patch.object(Policy, "reset", autospec=True) as reset:
        history.begin_drive()
        assert reset.call_count == 1
        teach(history, xs[10:], first=10)
        before = reset.call_count
        assert len(undo_examples(history, 5 * STEP_S)) == 5
        assert reset.call_count > before


def test_declaring_left_and_right_alike_is_an_edit() -> None:
    history = TrainingHistory(make_policy("default-8"))
    teach(history, vectors(history.policy, 10))
    history.edit("alike", value=True)
    assert history.policy.alike
    assert undo_edit(history) and not history.policy.alike


def test_a_change_that_cannot_be_repeated_is_reported_or_raised() -> None:
    policy, refused = make_policy("published-8"), list[LogEvent]()
    edit = Edited(verb="delete", node_id=99, value=None, at_s=0.0)
    lesson = Taught(
        example=Example(frame_id=1, label=Action.STOP, is_intervention=False),
        x=np.zeros(3),
        at_s=0.0,
    )
    replay(policy, [edit, lesson], lambda event, error: refused.append(event))
    assert refused == [edit, lesson]
    replay(policy, [edit])
    with pytest.raises(ValueError):
        replay(policy, [lesson])


def test_any_policy_learns_how_the_moves_of_this_body_steer() -> None:
    declared = [Move("left", steering=-0.25, throttle=0.5)]
    history = TrainingHistory(make_policy("published-8"), declared=declared)
    for policy in (history.policy, make_policy("published-4")):
        history.replace_policy(policy)
        assert history.policy.kinds.points["left"] == Point(-0.25, 0.5)


@crossed(learner=LEARNERS, seconds=[0.5, 5.0, 30.0])
def test_undo_leaves_no_trace_of_the_examples(learner: str, seconds: float) -> None:
    history = TrainingHistory(make_policy(learner))
    xs = vectors(history.policy, 450)
    teach(history, xs)
    gone = undo_examples(history, seconds)
    assert len(gone) == round(seconds / STEP_S)

    untouched = TrainingHistory(make_policy(learner))
    teach(untouched, xs[: len(xs) - len(gone)])
    assert same_nodes(history.policy.get_state(), untouched.policy.get_state())
    assert history.taught == untouched.taught

    teach(history, xs[:20], first=500)
    teach(untouched, xs[:20], first=500)
    assert same_nodes(history.policy.get_state(), untouched.policy.get_state())


@pytest.mark.parametrize("learner", LEARNERS)
def test_an_undone_example_is_not_the_last_one_of_an_image(learner: str) -> None:
    histories = [TrainingHistory(make_policy(learner)) for _ in range(2)]
    xs = vectors(histories[0].policy, 84)
    for history in histories:
        teach_forward(history, xs[:81], [0.125 * i for i in range(81)])  # then it is copied
    teach_forward(histories[0], xs[81:83], [10.125, 10.25])
    assert len(undo_examples(histories[0], 0.2)) == 2
    for history, at_s in zip(histories, (10.26, 10.01), strict=True):
        teach_forward(history, xs[83:], [at_s])  # too soon to be learned
    undone, untouched = (history.policy.get_state() for history in histories)
    assert same_nodes(undone, untouched)
    assert undone.params["last_taught"] == untouched.params["last_taught"]


def teach_forward(history: TrainingHistory, xs: list[np.ndarray], times_s: list[float]) -> None:
    for x, at_s in zip(xs, times_s, strict=True):
        example = Example(frame_id=0, label=Action.FORWARD, is_intervention=False)
        history.teach(example, x, at_s)
