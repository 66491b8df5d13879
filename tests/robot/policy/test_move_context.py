from __future__ import annotations

import json

import pytest

from robot.policy.example_selection import BOTH, ONSET_S, STRAIGHT, TURNING, MoveContext
from robot.policy.move_kinds import MoveKinds
from robot.types import Action
from tests.robot.policy.passing import see, teach

F, L, R, B = Action.FORWARD, Action.LEFT, Action.RIGHT, Action.BACKWARD
KINDS = MoveKinds((F, L, R, B))


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
def test_saved_in_the_middle_it_goes_on_alike(cut):
    whole, first, second = MoveContext(KINDS), MoveContext(KINDS), MoveContext(KINDS)
    drive = [(move, 0.1 * i) for i, move in enumerate([F] * 20 + [L] * 12 + [R] * 8 + [F] * 20)]
    expected = [note(whole, *example) for example in drive]
    noted = [note(first, *example) for example in drive[:cut]]
    second.load(
        json.loads(json.dumps(first.save()[0])), {}, {str(move): move for move in (F, L, R)}
    )
    assert noted + [note(second, *example) for example in drive[cut:]] == expected


@pytest.mark.parametrize(
    "wrong",
    [
        {"since_s": float("nan")},
        {"since_s": -1.0},
        {"since_s": 2.0},
        {"last_s": float("inf")},
    ],
)
def test_a_damaged_state_is_refused(wrong):
    with pytest.raises(ValueError, match=r"a move cannot last|since_s|last_s"):
        MoveContext(KINDS).load({**MoveContext(KINDS).save()[0], **wrong}, {})


def test_a_body_whose_turns_are_not_known_has_one_context():
    contexts = MoveContext(MoveKinds((Action("gas"), Action("brake"))))
    assert {note(contexts, Action("gas"), 0.1 * step) for step in range(20)} == {BOTH}
