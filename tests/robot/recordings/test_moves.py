"""The moves of a body survive a recording."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.moves import Move, names
from robot.recordings.moves import from_text, to_text
from tests.robot.test_driver_moves import moves


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
