"""Any name can be a move, and the driver's declaration of it is also stored in recordings."""

from __future__ import annotations

import copy
import gc
import json
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.moves import CLASSIC, Move, describe, move_at, names, point_of, side_of
from robot.recordings.moves import from_text, to_text
from robot.types import DEFAULT_MOVES, Action, Point

NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,31}", fullmatch=True)
SHARES = st.floats(-1.0, 1.0)
POINTS = st.one_of(st.just((None, None)), st.tuples(SHARES, SHARES))
WORDS = st.text(min_size=1, max_size=24)
LABELS = st.one_of(st.just(""), WORDS, st.dictionaries(st.sampled_from(["en", "es", "zh"]), WORDS))


@st.composite
def moves(draw: st.DrawFn) -> Move:
    name = draw(NAMES.filter(lambda name: name != "stop"))
    steering, throttle = draw(POINTS)
    words = draw(LABELS), draw(st.text(max_size=16)), draw(st.text(max_size=200))
    return Move(Action(name), *words, steering=steering, throttle=throttle)


@given(NAMES)
def test_each_move_name_has_one_object(name: str) -> None:
    action = Action("".join(name))  # not identical strings
    assert action is Action(name)
    assert action == name and hash(action) == hash(name) and str(action) == action.value == name
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        assert pickle.loads(pickle.dumps(action, protocol)) is action
    assert copy.copy(action) is action and copy.deepcopy([action])[0] is action
    assert json.loads(json.dumps({action: action})) == {name: name}


def test_names_of_moves_that_nobody_uses_are_not_kept() -> None:
    kept = Action("kept_by_somebody")
    before = len(Action._interned)
    for number in range(10_000):
        Action(f"made_up_{number}")
    gc.collect()
    assert len(Action._interned) <= before
    assert Action("kept_by_somebody") is kept


def test_threads_that_meet_a_new_name_get_one_object() -> None:
    for number in range(50):
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(lambda _, n=number: Action(f"met_{n}"), range(8)))
        assert len({id(action) for action in found}) == 1


@given(
    st.text().filter(lambda text: not text.isascii() or not text.isidentifier())
    | st.sampled_from(["Fast", "1st", "_x", "", "a" * 33, "a,b", "a b", 7, None, b"a"])
)
def test_names_that_would_break_a_file_or_a_page_are_refused(name: object) -> None:
    with pytest.raises(ValueError, match="not a valid name of a move"):
        Action(name)


def test_known_moves_need_no_declaration_and_unknown_ones_have_their_name() -> None:
    fast = Move(Action("fast"), "Fast", steering=0.0, throttle=1.0)
    described = describe([Action.LEFT, Action("fast"), Action("push")], [fast])
    assert described == (CLASSIC[Action.LEFT], fast, Move(Action("push")))
    assert point_of(Action("fast"), [fast]) == (0.0, 1.0)
    assert point_of(Action("push"), [fast]) is None
    assert point_of(Action.STOP) == (0.0, 0.0)
    assert names(describe(DEFAULT_MOVES)) == DEFAULT_MOVES


def test_a_declaration_in_numbers_of_numpy_can_be_sent() -> None:
    move = Move(Action("fast"), steering=np.float32(0.5), throttle=np.int64(1))
    assert json.loads(json.dumps(move.describe()))["steering"] == 0.5
    assert move_at(Point(0.5, 1.0), [move]) == "fast"


@pytest.mark.parametrize(
    "fields",
    [
        {"steering": 0.5},
        {"throttle": 0.5},
        {"steering": 1.5, "throttle": 0.0},
        {"steering": float("nan"), "throttle": 0.0},
        {"label": "x" * 25},
        {"label": {"en": ""}},
        {"icon": "x" * 17},
    ],
)
def test_a_declaration_out_of_range_is_refused(fields: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="fast"):
        Move(Action("fast"), **fields)
    with pytest.raises(ValueError, match="stop"):
        Move(Action.STOP)


@given(st.lists(moves(), max_size=8), SHARES, SHARES)
def test_a_point_counts_as_a_move_that_goes_its_way(
    declared: list[Move], steering: float, throttle: float
) -> None:
    point = Point(steering, throttle)
    found = move_at(point, declared)
    way = side_of(throttle, 0.0)
    same = [move for move in declared if move.point and side_of(move.point[1], 0.0) == way]
    if found is None:
        assert way == 0 or not same
        return
    assert found in names(same)


def test_a_point_counts_as_the_declared_move_with_the_nearest_steering() -> None:
    for move in CLASSIC.values():
        assert move.point is not None and move_at(move.point, CLASSIC.values()) is move.name
    three = describe(DEFAULT_MOVES)
    cut = [move_at(Point(steering, 0.3), three) for steering in (-0.21, -0.2, 0.2, 0.21)]
    assert cut == [Action.LEFT, Action.FORWARD, Action.FORWARD, Action.RIGHT]
    five = [Move(Action(f"at{n}"), steering=n / 2 - 1.0, throttle=0.5) for n in range(5)]
    assert move_at(Point(0.7, 0.5), five) == "at3" and move_at(Point(0.8, 0.5), five) == "at4"
    assert move_at(Point(1.0, 0.0), three) is None and move_at(Point(0.0, -1.0), three) is None
    for bad in (float("nan"), 1.1, -float("inf")):
        with pytest.raises(ValueError, match="must lie in"):
            move_at(Point(bad, 0.0), three)


@given(st.lists(moves(), max_size=8))
def test_a_declaration_survives_a_recording(declared: list[Move]) -> None:
    back = from_text(to_text(declared))
    assert names(back) == names(declared)
    for before, after in zip(declared, back, strict=True):
        assert before.describe() == after.describe()
        assert before.point == after.point


@pytest.mark.parametrize(
    "text", ["{", "[1]", '[{"name": "x"}]', '{"name": 1}', '[{"name": "X", "label": {}}]', "7"]
)
def test_a_damaged_declaration_is_reported(text: str) -> None:
    with pytest.raises(ValueError):
        from_text(text)
