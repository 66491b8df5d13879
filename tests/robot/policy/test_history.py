"""The history teaches examples, and undoes them as if they had never been taught."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from robot.coaching.gallery import images
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
from tests.kit.states import same_state
from tests.robot.bench_robot import BenchRobot

MOVES = (Action.FORWARD, Action.LEFT, Action.RIGHT)
STEP_S = 0.1


def vectors(policy: Policy, count: int) -> list[np.ndarray]:
    camera = BenchRobot().camera
    return [policy.extract(camera.show(scene)) for scene in range(count)]


def teach(history: TrainingHistory, xs: Iterable[np.ndarray], first: int = 0) -> None:
    for i, x in enumerate(xs, start=first):
        example = Example(frame_id=i, label=MOVES[i % 3], is_intervention=i % 5 == 0)
        history.teach(example, x, captured_s=i * STEP_S)


def teach_at(history: TrainingHistory, *times_s: float) -> None:
    """Teach one example at exactly each of these teaching times."""
    xs = vectors(history.policy, 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("robot.policy.history._LONGEST_STEP_S", math.inf)
        for number, at_s in enumerate(times_s):
            example = Example(frame_id=number, label=MOVES[number % 3], is_intervention=False)
            history.teach(example, xs[number % 3], at_s)


@pytest.fixture
def history():
    """A history of the published learner, which was taught nothing."""
    return TrainingHistory(make_policy("published-8"))


@pytest.mark.parametrize("learner", ["published-8", "default-8", "integer-8"])
def test_examples_taught_in_batches_leave_the_same_learner_bit_for_bit(learner):
    """Teach batches of 1 to 5 examples at thirty frames a second, with pauses and an undo."""
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
        gone = [example.frame_id for example in undo_examples(one, seconds)]
        assert gone == [example.frame_id for example in undo_examples(many, seconds)]
        assert same_state(one.policy.get_state(), many.policy.get_state())


# Undo -------------------------------------------------------------------------------------------


@crossed(learner=["published-8", "default-8"], seconds=[0.5, 5.0, 30.0])
def test_undo_leaves_no_trace_of_the_examples_even_after_the_log_was_shortened(learner, seconds):
    history, untouched = (TrainingHistory(make_policy(learner)) for _ in range(2))
    xs = vectors(history.policy, 150)
    teach(history, 4 * xs)
    assert len(last_examples(history, 1e9)) < 600
    n_gone = len(undo_examples(history, seconds))
    assert n_gone == round(seconds / STEP_S)
    teach(untouched, (4 * xs)[:-n_gone])
    assert history.taught == untouched.taught
    for more in ([], xs[:20]):
        for one in (history, untouched):
            teach(one, more, first=700)
        assert same_nodes(history.policy.get_state(), untouched.policy.get_state())


def test_undo_can_be_repeated_back_to_the_beginning(history):
    fresh = history.policy.get_state()
    teach(history, vectors(history.policy, 120))
    n_gone = [len(undo_examples(history, seconds)) for seconds in (5.0, 5.0, 30.0, 5.0)]
    assert n_gone == [50, 50, 20, 0]
    assert same_nodes(history.policy.get_state(), fresh)
    assert history.taught.total() == 0


def test_undo_counts_teaching_time_not_pauses(history):
    xs = vectors(history.policy, 20)
    teach(history, xs[:10])
    teach(history, xs[10:], first=10_000)
    assert len(undo_examples(history, 1.45)) == 10 + 1


def test_teaching_time_begins_at_zero_and_undo_turns_it_back():
    told: list[HistoryEvent] = []
    history = TrainingHistory(make_policy("published-8"), told.extend)
    xs = vectors(history.policy, 3)
    teach(history, xs[:2], first=100)
    undo_examples(history, 5.0)
    teach(history, xs[2:], first=102)
    times_s = [event.at_s for event in told if isinstance(event, Taught)]
    assert times_s == pytest.approx([0.0, STEP_S, STEP_S])


def test_an_undo_learns_again_only_what_came_after_the_snapshot_before_it(history, monkeypatch):
    teach_at(history, *(step * 0.5 for step in range(22)))  # the snapshots are at 10.0 and 10.5
    learned_s: list[float] = []
    learn = history.policy.learn

    def listen(x, label, at_s, point):
        learned_s.append(at_s)
        learn(x, label, at_s)

    monkeypatch.setattr(history.policy, "learn", listen)
    assert [example.frame_id for example in undo_examples(history, 0.5)] == [21]
    assert learned_s == []
    assert [example.frame_id for example in undo_examples(history, 0.5)] == [20]
    assert learned_s == [step * 0.5 for step in range(20)]


def test_the_learner_is_copied_every_ten_seconds_and_not_more_often():
    policy = make_policy("published-8")
    with mock.patch.object(policy, "get_state", wraps=policy.get_state) as copied:
        teach(TrainingHistory(policy), vectors(policy, 1) * 311)
    assert copied.call_count == 1 + 3


@pytest.mark.parametrize(("last_s", "n_undone", "n_kept"), [(46.5, 4, 5), (47.0, 3, 3)])
def test_the_log_keeps_no_more_snapshots_than_an_undo_of_35_seconds_needs(
    history, last_s, n_undone, n_kept
):
    teach_at(history, 0.0, 12.0, 24.0, 36.0, last_s)
    assert len(last_examples(history, 35.0)) == n_undone
    assert len(undo_examples(history, 1e9)) == n_kept
    assert history.taught.total() == 5 - n_kept


@pytest.mark.parametrize("learner", ["published-8", "default-8"])
def test_an_undone_example_is_not_the_last_one_of_an_image(learner):
    undone, untouched = (TrainingHistory(make_policy(learner)) for _ in range(2))
    xs = vectors(undone.policy, 84)

    def teach_forward(history, x, at_s):
        example = Example(frame_id=0, label=Action.FORWARD, is_intervention=False)
        history.teach(example, x, at_s)

    for i, x in enumerate(xs[:81]):  # at this time, a snapshot copies the state
        for history in (undone, untouched):
            teach_forward(history, x, 0.125 * i)
    for x, at_s in zip(xs[81:83], (10.125, 10.25), strict=True):
        teach_forward(undone, x, at_s)
    assert len(undo_examples(undone, 0.2)) == 2
    teach_forward(undone, xs[83], 10.26)  # this example follows too soon to be learned
    teach_forward(untouched, xs[83], 10.01)
    states = [history.policy.get_state() for history in (undone, untouched)]
    assert same_nodes(*states)
    assert states[0].params["last_taught"] == states[1].params["last_taught"]


# Plugins that refuse ----------------------------------------------------------------------------

N_PARTS = len(make_policy("default-8")._learning)


class Plugin(PolicyPart):
    """A part that refuses the given calls, after the parts before it have learned."""

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
def test_an_example_that_a_plugin_refuses_leaves_no_trace_and_undo_is_exact(done):
    policy, untouched = make_policy("default-8"), TrainingHistory(make_policy("default-8"))
    plugin, history = Plugin(policy, done), TrainingHistory(policy)
    assert history.batch == 1, "a plugin may refuse an example, so each batch has one"
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
        assert same_state(history.policy.get_state(), untouched.policy.get_state())
        assert (history.taught, history.teaching_s) == (untouched.taught, untouched.teaching_s)


@pytest.mark.parametrize("error", [RuntimeError("not today"), ValueError("not today")])
def test_if_a_plugin_refuses_to_learn_again_nothing_is_undone(error):
    policy = make_policy("default-8")
    plugin, history = Plugin(policy, 3), TrainingHistory(policy)
    teach(history, vectors(policy, 26))
    history.edit("outdate")
    before, plugin.refuses, plugin.error = policy.get_state(), True, error
    for undo in (lambda: undo_examples(history, 0.45), lambda: undo_edit(history)):
        with pytest.raises(type(error)):
            undo()
        assert same_state(policy.get_state(), before)
        assert history.taught.total() == 26
    plugin.refuses = False
    assert len(undo_examples(history, 0.45)) == 5
    assert undo_edit(history)


# Edits ------------------------------------------------------------------------------------------


def test_each_edit_does_what_it_says_and_only_the_last_is_undone(history):
    teach(history, vectors(history.policy, 30))
    first, second, *_ = (image.node_id for image in images(history.policy))

    def node(node_id):
        return next(image for image in images(history.policy) if image.node_id == node_id)

    for value in (True, False):
        history.edit("pin", first, value)
        assert node(first).is_pinned is value
    history.edit("delete", second)
    assert second not in {image.node_id for image in images(history.policy)}
    before = history.policy.get_state()
    wrong = min(MOVES, key=lambda move: node(first).votes.get(move, 0))
    history.edit("relabel", first, wrong)
    assert {move for move, votes in node(first).votes.items() if votes} == {wrong}
    assert undo_edit(history)
    assert same_nodes(history.policy.get_state(), before)
    assert [undo_edit(history) for _ in range(4)] == [True, True, True, False]
    assert history.taught.total() == 30


def test_declaring_earlier_examples_outdated_is_an_edit():
    history = TrainingHistory(make_policy("default-8"))
    xs = vectors(history.policy, 30)

    def is_outdated():
        params: Any = history.policy.get_state().params["learner"]
        return params["outdated_before"] > 0

    teach(history, xs[:20])
    assert not is_outdated()
    history.edit("outdate")
    assert history.events[-1].node_id == 0, "the event has the node id that is documented"
    teach(history, xs[20:], first=20)
    undo_examples(history, 0.25)
    assert is_outdated(), "undoing examples does not undo the edit"
    assert undo_edit(history) and not is_outdated()


def test_undoing_lessons_keeps_the_edits_made_meanwhile(history):
    xs = vectors(history.policy, 40)
    teach(history, xs[:8])
    history.edit("relabel", images(history.policy)[0].node_id, Action.RIGHT)
    with_edit = history.policy.get_state()
    teach(history, xs[8:12], first=8)
    assert len(undo_examples(history, 0.35)) == 4
    assert same_nodes(history.policy.get_state(), with_edit)


def test_a_bad_edit_is_refused_and_changes_nothing(history):
    teach(history, vectors(history.policy, 8))
    before = history.policy.get_state()
    with pytest.raises(LookupError):
        history.edit("delete", 10_000)
    for verb, why in (("paint", "unknown edit"), ("relabel", "not one of the moves")):
        with pytest.raises(ValueError, match=why):
            history.edit(verb, images(history.policy)[0].node_id, Action("fly"))
    assert same_nodes(history.policy.get_state(), before)


def test_a_change_that_cannot_be_repeated_is_reported_or_raised():
    policy, refused = make_policy("published-8"), list[LogEvent]()
    edit = Edited(verb="delete", node_id=99, value=None, at_s=0.0)
    example = Example(frame_id=1, label=Action.STOP, is_intervention=False)
    lesson = Taught(example=example, x=np.zeros(3), at_s=0.0)
    replay(policy, [edit, lesson], lambda event, error: refused.append(event))
    assert refused == [edit, lesson]
    replay(policy, [edit])
    with pytest.raises(ValueError):
        replay(policy, [lesson])


# Counts, policies and drives --------------------------------------------------------------------


def test_each_change_is_counted_and_reported_once():
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
    assert history.edits == len(told) - 3, "the first three changes were examples, not edits"


def test_an_exchanged_policy_keeps_its_training_which_cannot_be_undone():
    declared = [Move("left", steering=-0.25, throttle=0.5)]
    history = TrainingHistory(make_policy("published-8"), declared=declared)
    assert history.policy.kinds.points["left"] == Point(-0.25, 0.5)
    teach(history, vectors(history.policy, 3))
    loaded = make_policy("published-4")
    history.replace_policy(loaded, Counter({Action.FORWARD: 5}))
    assert (history.policy, history.taught.total()) == (loaded, 5)
    assert loaded.kinds.points["left"] == Point(-0.25, 0.5), "the model contains the body's points"
    assert undo_examples(history, 30.0) == []
    before = loaded.get_state()
    teach(history, vectors(loaded, 2), first=3)
    assert history.taught.total() == 7
    assert len(undo_examples(history, 30.0)) == 2
    assert same_nodes(loaded.get_state(), before)
    assert history.taught == {Action.FORWARD: 5}
    history.replace_policy(make_policy("published-4"))
    assert history.taught.total() == 0


def test_a_drive_counts_only_if_something_was_taught_in_it(history):
    xs = vectors(history.policy, 2)
    counted = []
    for step in (None, xs[:1], None, None, xs[1:], None):
        if step is None:
            history.begin_drive()
        else:
            teach(history, step)
        counted.append(history.drives)
    assert counted == [0, 0, 1, 1, 1, 2]


def test_a_drive_begins_with_a_reset_policy_also_when_it_is_learned_again(history):
    xs = vectors(history.policy, 20)
    teach(history, xs[:10])
    with mock.patch.object(Policy, "reset", autospec=True) as reset:
        history.begin_drive()
        assert reset.call_count == 1
        teach(history, xs[10:], first=10)
        before = reset.call_count
        assert len(undo_examples(history, 5 * STEP_S)) == 5
        assert reset.call_count > before
