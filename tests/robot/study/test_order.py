"""The order of conditions is balanced by position and by the preceding condition."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest

from robot.study.plan import parse_plan, williams_rows

from .scripted import small_plan


@pytest.mark.parametrize("n", range(1, 9))
def test_each_condition_stands_equally_often_at_each_place_and_after_each_other(n: int) -> None:
    rows = williams_rows(n)
    assert all(sorted(row) == list(range(n)) for row in rows)
    assert set(Counter(enumerated for row in rows for enumerated in enumerate(row)).values()) == {
        len(rows) // n
    }
    after = Counter(pair for row in rows for pair in itertools.pairwise(row))
    assert len(after) == n * (n - 1) and len(set(after.values())) <= 1


def test_two_conditions_alternate() -> None:
    names = ("short", "long"), ("long", "short")
    assert [small_plan().order(slot) for slot in range(4)] == [*names, *names]


@pytest.mark.parametrize("n", range(1, 9))
def test_between_participants_each_meets_one_in_turn(n: int) -> None:
    conditions = "".join(f'[[condition]]\nname = "c{i}"\n' for i in range(n))
    phase = '[[phase]]\nkind = "teach"\nseconds = 1\n'
    plan = parse_plan(f'title = "x"\nworld = "box"\ndesign = "between"\n{phase}{conditions}')
    met = Counter(plan.order(slot) for slot in range(3 * n))
    assert met == {(f"c{i}",): 3 for i in range(n)}
