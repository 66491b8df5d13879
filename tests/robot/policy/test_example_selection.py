"""Which examples are learned, and in which contexts each example counts."""

from __future__ import annotations

import json
import math
import random
from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.policy.example_selection import (
    BOTH,
    ONSET_S,
    ROOM_S,
    STRAIGHT,
    TURNING,
    ExampleRate,
    MoveContext,
)
from robot.policy.move_kinds import MoveKinds
from robot.policy.registry import make_policy
from robot.types import Action
from tests.robot.policy.passing import see, teach

F, L, R, B = Action.FORWARD, Action.LEFT, Action.RIGHT, Action.BACKWARD
MOVES = (F, L, R, B)
KINDS = MoveKinds(MOVES)

# The rate of examples ---------------------------------------------------------------------------


def admits(rate, label, at_s):
    return teach(rate, label, at_s).is_learned


def learned(times_s):
    rate = ExampleRate()
    return [at_s for at_s in times_s if admits(rate, F, at_s)]


def times_of(gaps_s):
    return list(accumulate(gaps_s[:-1], initial=0.0))


@given(rate_hz=st.floats(10.0, 120.0), jitter=st.floats(0.0, 0.15), seed=st.integers(0, 99))
def test_any_camera_of_ten_frames_a_second_or_more_teaches_ten_a_second(rate_hz, jitter, seed):
    """Each frame is early or late by up to this share of the frame period."""
    dice, n_frames = random.Random(seed), round(20 * rate_hz)
    times_s = [(i + dice.uniform(-jitter, jitter)) / rate_hz for i in range(1, n_frames)]
    assert len(learned(times_s)) == pytest.approx(10.0 * (times_s[-1] - times_s[0]), abs=2.5)


@given(gaps_s=st.lists(st.floats(0.001, 0.5), min_size=2, max_size=80))
def test_at_most_ten_examples_a_second_are_learned(gaps_s):
    times_s = times_of(gaps_s)
    assert len(learned(times_s)) <= 10.0 * times_s[-1] + 1.5


@given(rate_hz=st.floats(0.5, 10.0))
def test_a_slower_camera_teaches_every_frame(rate_hz):
    times_s = [i / rate_hz for i in range(200)]
    assert learned(times_s) == times_s


@given(st.lists(st.tuples(st.sampled_from("FLR"), st.floats(0.0, 0.3)), min_size=2, max_size=60))
def test_the_first_example_of_another_label_is_learned(steps):
    labels, times_s = [label for label, _ in steps], times_of([gap_s for _, gap_s in steps])
    rate = ExampleRate()
    admitted = [admits(rate, *example) for example in zip(labels, times_s, strict=True)]
    assert all(admitted[i] for i in range(len(labels)) if i == 0 or labels[i] != labels[i - 1])


@pytest.mark.parametrize("at_s", [5.0, 5.1, 20.0])
def test_the_selection_begins_anew_after_a_pause_or_an_earlier_time(at_s):
    times_s = [10.0, at_s, at_s + 0.5 * ROOM_S, at_s + ROOM_S]
    rate = ExampleRate()
    assert [admits(rate, F, time_s) for time_s in times_s] == [True, True, False, True]


def test_an_example_without_a_time_is_learned_and_so_is_the_next():
    rate = ExampleRate()
    admitted = [admits(rate, F, time_s) for time_s in (0.0, None, None, 0.01, 0.02)]
    assert admitted == [True, True, True, True, False]


# Contexts ---------------------------------------------------------------------------------------


def note(context, label, at_s):
    return teach(context, label, at_s).contexts


def context_of(move):
    return see(MoveContext(KINDS), under_way=move).context


def run(moves, step_s):
    """Return the contexts of each example of a drive, which is given by its moves with their
    durations in seconds."""
    contexts, now_s, noted = MoveContext(KINDS), 0.0, []
    for move, length_s in moves:
        for _ in range(round(length_s / step_s)):
            noted.append(note(contexts, move, now_s))
            now_s += step_s
    return noted


@pytest.mark.parametrize("rate_hz", [4, 9, 15, 31])
def test_the_first_half_second_of_a_move_ends_the_one_before(rate_hz):
    noted = run([(F, 2.0), (L, 2.0), (F, 2.0)], 1 / rate_hz)
    for begun, move in ((2 * rate_hz, L), (4 * rate_hz, F)):
        late = begun + int(ONSET_S * rate_hz) + 1
        assert set(noted[begun:late]) == {BOTH}
        assert set(noted[late : begun + 2 * rate_hz]) == {(context_of(move),)}


def test_a_move_of_the_same_kind_ends_nothing():
    noted = run([(L, 1.0), (R, 1.0), (F, 1.0), (B, 1.0)], 0.1)
    assert (set(noted[10:20]), set(noted[30:40])) == ({(TURNING,)}, {(STRAIGHT,)})


@pytest.mark.parametrize("again", [F, L])
def test_after_a_pause_nothing_is_known_of_what_went_before(again):
    contexts = MoveContext(KINDS)
    for step in range(20):
        note(contexts, F, 0.1 * step)
    assert note(contexts, again, 2.4) == BOTH
    assert note(contexts, again, 2.4 + ONSET_S + 0.01) == BOTH, "this gap is a pause, too"
    assert note(contexts, again, 2.6 + ONSET_S) == BOTH
    for step in range(5):
        last = note(contexts, again, 2.7 + ONSET_S + 0.1 * step)
    assert last == (context_of(again),)
    assert note(contexts, again, None) == BOTH
    assert note(contexts, again, 4.0) == BOTH, "the example without a time hides what went before"


@pytest.mark.parametrize("cut", range(0, 60, 7))
def test_a_selection_that_is_saved_and_restored_continues_the_same(cut):
    """The pilot teaches 14 examples a second, so some of them come too soon."""
    drive = [(move, 0.07 * i) for i, move in enumerate([F] * 20 + [L] * 12 + [R] * 8 + [F] * 20)]
    for make in (lambda: MoveContext(KINDS), ExampleRate):
        whole, restored = make(), make()
        for i, example in enumerate(drive):
            if i == cut:
                saved = json.loads(json.dumps(whole.save()[0]))
                restored.load(saved, {}, {str(move): move for move in MOVES})
            expected = teach(whole, *example)
            if i >= cut:
                noted = teach(restored, *example)
                assert noted.contexts == expected.contexts
                assert noted.is_learned == expected.is_learned


@pytest.mark.parametrize(
    "wrong", [{"since_s": math.nan}, {"since_s": -1.0}, {"since_s": 2.0}, {"last_s": math.inf}]
)
def test_a_damaged_state_is_refused(wrong):
    with pytest.raises(ValueError, match=r"a move cannot last|since_s|last_s"):
        MoveContext(KINDS).load({**MoveContext(KINDS).save()[0], **wrong}, {})


def test_a_body_whose_turns_are_not_known_has_one_context():
    contexts = MoveContext(MoveKinds((Action("gas"), Action("brake"))))
    assert {note(contexts, Action("gas"), 0.1 * step) for step in range(20)} == {BOTH}


# Repeated views ---------------------------------------------------------------------------------


def lap(seed, n=40, size=1584):
    rng = np.random.default_rng(seed)
    return [(rng.integers(0, 128, size).astype(np.uint8), MOVES[i // 5 % 3]) for i in range(n)]


def drive(policy, *laps):
    for examples in laps:
        for x, label in examples:
            policy.learn(x, label)
        policy.reset()
    return policy


def test_sixty_four_equal_laps_teach_exactly_as_much_as_one():
    policies = [drive(make_policy("default-8"), *[lap(0)] * times) for times in (1, 64)]
    once, often = (policy.learner.get_state() for policy in policies)
    assert once.params == often.params
    assert all(np.array_equal(array, often.arrays[name]) for name, array in once.arrays.items())
    assert policies[1].n_seen == 64 * 40


def test_laps_that_differ_are_all_learned():
    assert drive(make_policy("default-8"), *map(lap, range(5))).learner.n_seen_ == 5 * 40


def test_a_contrary_label_is_learned_however_often_the_other_label_was_taught():
    policy, (x, label) = make_policy("default-8"), lap(0)[0]
    for n, (move, times) in enumerate([(label, 30), (L, 3), (R, 3), (L, 3)], 1):
        drive(policy, [(x, move)] * times)
        assert policy.learner.n_seen_ == n


def test_the_known_views_are_saved_with_the_model():
    policy, again = drive(make_policy("default-2"), lap(1, 200)), make_policy("default-2")
    again.set_state(policy.get_state())
    assert drive(again, lap(1, 200)).learner.n_seen_ == 200


@pytest.mark.parametrize(
    ("name", "size"),
    [("published-8", 1200), ("without-repeats-8", 1584), ("integer-8", 1360), ("knn-3", 1584)],
)
def test_other_learners_learn_each_lap(name, size):
    policy = drive(make_policy(name), *[lap(0, size=size)] * 2)
    assert getattr(policy.learner, "n_seen_", policy.n_seen) == 80
