"""The curve of agreement: its marks as columns."""

from __future__ import annotations

import sys
import tracemalloc

from server.coaching.progress import Mark, _Curve


def curve_of(count: int) -> tuple[_Curve, list[Mark]]:
    curve, marks = _Curve(), []
    for number in range(1, count + 1):
        mark = Mark(10 * number, 1 / number, 1e9 + number, "run" if number % 2 else None)
        curve.add(mark)
        marks.append(mark)
    return curve, marks


def test_a_curve_returns_its_marks_and_forgets_those_that_were_undone() -> None:
    curve, marks = curve_of(250)
    assert [curve[index] for index in range(len(curve))] == marks
    assert [curve.place(n) for n in (1, 10, 11, 2500, 2501)] == [0, 0, 1, 249, 250]
    part = curve.until(1005)
    assert [part[index] for index in range(len(part))] == marks[:100]
    assert curve[-1] == marks[-1], "the curve that others read did not change"
    assert curve.until(0).place(5) == 0 == len(curve.until(0))


def test_a_curve_needs_few_bytes_a_mark() -> None:
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        curve = _Curve()
        for number in range(1000):
            curve.add(Mark(10 * number, 0.5, 1e9 + number, None))
        assert tracemalloc.get_traced_memory()[0] - before < 60 * len(curve) + sys.getsizeof(curve)
    finally:
        tracemalloc.stop()
