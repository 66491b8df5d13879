"""Which examples are learned, and the contexts in which each counts."""

from __future__ import annotations

import json
import math
import random
from itertools import accumulate

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
from robot.types import Action
from tests.robot.policy.passing import see, teach

F, L, R, B = Action.FORWARD, Action.LEFT, Action.RIGHT, Action.BACKWARD
KINDS = MoveKinds((F, L, R, B))


def admits(rate, label, at_s):
    return teach(rate, label, at_s).is_learned


def learned(times_s):
    rate = ExampleRate()
    return [at_s for at_s in times_s if admits(rate, "FORWARD", at_s)]


def times_of(gaps_s):
    return list(accumulate(gaps_s[:-1], initial=0.0))


def unsteady(rate_hz, jitter, seed, seconds=20.0):
    """Return the times of frames that are early or late by up to a share of the frame period."""
    dice = random.Random(seed)
    return [
        (i + dice.uniform(-jitter, jitter)) / rate_hz for i in range(1, round(seconds * rate_hz))
    ]


@given(rate_hz=st.floats(10.0, 120.0), jitter=st.floats(0.0, 0.15), seed=st.integers(0, 99))
def test_any_camera_of_ten_frames_a_second_or_more_teaches_ten_a_second(rate_hz, jitter, seed):
    times_s = unsteady(rate_hz, jitter, seed)
    assert len(learned(times_s)) == pytest.approx(10.0 * (times_s[-1] - times_s[0]), abs=2.5)


@given(gaps_s=st.lists(st.floats(0.001, 0.5), min_size=2, max_size=80))
def test_never_more_than_ten_a_second(gaps_s):
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
    changes = [i for i in range(len(labels)) if i == 0 or labels[i] != labels[i - 1]]
    assert all(admitted[i] for i in changes)


@pytest.mark.parametrize("at_s", [5.0, 5.1, 20.0])
def test_the_selection_begins_anew_after_a_pause_or_an_earlier_time(at_s):
    rate = ExampleRate()
    assert admits(rate, "FORWARD", 10.0)
    assert admits(rate, "FORWARD", at_s)
    assert not admits(rate, "FORWARD", at_s + 0.5 * ROOM_S)
    assert admits(rate, "FORWARD", at_s + ROOM_S)


def test_an_example_without_a_time_stands_for_itself():
    rate = ExampleRate()
    assert admits(rate, "FORWARD", 0.0)
    assert admits(rate, "FORWARD", None)
    assert admits(rate, "FORWARD", None)
    assert admits(rate, "FORWARD", 0.01), "nothing is known of the one before"
    assert not admits(rate, "FORWARD", 0.02)


@given(gaps_s=st.lists(st.floats(0.01, 0.3), min_size=2, max_size=60), cut=st.integers(0, 59))
def test_a_restored_selection_continues_where_it_was_saved(gaps_s, cut):
    one, other = ExampleRate(), ExampleRate()
    for i, at_s in enumerate(times_of(gaps_s)):
        if i == cut:
            other.load(json.loads(json.dumps(one.save()[0])), {})
        if i < cut:
            admits(one, "FORWARD", at_s)
        else:
            assert admits(one, "FORWARD", at_s) == admits(other, "FORWARD", at_s)


# Contexts ---------------------------------------------------------------------------------------


def note(context, label, at_s):
    return teach(context, label, at_s).contexts


def context_of(move):
    return see(MoveContext(KINDS), under_way=move).context


def run(moves, step_s):
    """Return the contexts of each example of a drive: moves with their durations in seconds."""
    contexts, now_s, noted = MoveContext(KINDS), 0.0, []
    for move, length_s in moves:
        for _ in range(round(length_s / step_s)):
            noted.append((move, note(contexts, move, now_s)))
            now_s += step_s
    return noted


@pytest.mark.parametrize("rate_hz", [4, 9, 15, 31])
def test_the_first_half_second_of_a_move_ends_the_one_before(rate_hz):
    noted = run([(F, 2.0), (L, 2.0), (F, 2.0)], 1 / rate_hz)
    for begun in (2 * rate_hz, 4 * rate_hz):
        move = noted[begun][0]
        early = [contexts for _, contexts in noted[begun : begun + int(ONSET_S * rate_hz) + 1]]
        late = [contexts for _, contexts in noted[begun + len(early) : begun + 2 * rate_hz]]
        assert set(early) == {BOTH}
        assert set(late) == {(context_of(move),)}


def test_a_move_of_the_same_kind_ends_nothing():
    noted = run([(L, 1.0), (R, 1.0), (F, 1.0), (B, 1.0)], 0.1)
    assert {contexts for move, contexts in noted[10:20]} == {(TURNING,)}
    assert {contexts for move, contexts in noted[30:40]} == {(STRAIGHT,)}


@pytest.mark.parametrize("again", [F, L])
def test_after_a_pause_nothing_is_known_of_what_went_before(again):
    contexts = MoveContext(KINDS)
    for step in range(20):
        note(contexts, F, 0.1 * step)
    assert note(contexts, again, 2.4) == BOTH
    assert note(contexts, again, 2.4 + ONSET_S + 0.01) == BOTH, "that was a pause again"
    assert note(contexts, again, 2.6 + ONSET_S) == BOTH
    for step in range(5):
        last = note(contexts, again, 2.7 + ONSET_S + 0.1 * step)
    assert last == (context_of(again),)


def test_an_example_without_a_time_counts_in_both():
    contexts = MoveContext(KINDS)
    for step in range(20):
        note(contexts, F, 0.1 * step)
    assert note(contexts, F, None) == BOTH
    assert note(contexts, F, 2.0) == BOTH, "what went before it is not known either"


@pytest.mark.parametrize("cut", range(0, 60, 7))
def test_contexts_saved_in_the_middle_continue_alike(cut):
    whole, first, second = MoveContext(KINDS), MoveContext(KINDS), MoveContext(KINDS)
    drive = [(move, 0.1 * i) for i, move in enumerate([F] * 20 + [L] * 12 + [R] * 8 + [F] * 20)]
    expected = [note(whole, *example) for example in drive]
    noted = [note(first, *example) for example in drive[:cut]]
    second.load(
        json.loads(json.dumps(first.save()[0])), {}, {str(move): move for move in (F, L, R)}
    )
    assert noted + [note(second, *example) for example in drive[cut:]] == expected


@pytest.mark.parametrize(
    "wrong", [{"since_s": math.nan}, {"since_s": -1.0}, {"since_s": 2.0}, {"last_s": math.inf}]
)
def test_a_damaged_state_is_refused(wrong):
    with pytest.raises(ValueError, match=r"a move cannot last|since_s|last_s"):
        MoveContext(KINDS).load({**MoveContext(KINDS).save()[0], **wrong}, {})


def test_a_body_whose_turns_are_not_known_has_one_context():
    contexts = MoveContext(MoveKinds((Action("gas"), Action("brake"))))
    assert {note(contexts, Action("gas"), 0.1 * step) for step in range(20)} == {BOTH}
