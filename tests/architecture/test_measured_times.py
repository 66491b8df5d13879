"""No test compares a time measured on the machine's clock with less than five seconds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
CLOCKS = {"time.monotonic", "time.perf_counter", "time.time", "RealClock().now_s"}
LEAST_S = 5.0
_SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef)


def is_measured(node: ast.AST, names: set[str]) -> bool:
    """True if this expression reads a clock, or contains a name that holds a reading."""
    return any(
        (isinstance(part, ast.Call) and ast.unparse(part.func) in CLOCKS)
        or (isinstance(part, ast.Name) and part.id in names)
        for part in ast.walk(node)
    )


def hasty(source: str) -> Iterator[str]:
    """Yield each comparison of a measured time with a number that is too small."""
    for scope in ast.walk(ast.parse(source)):
        if not isinstance(scope, _SCOPES):
            continue
        names: set[str] = set()
        for node in ast.walk(scope):
            if isinstance(node, ast.Assign) and is_measured(node.value, names):
                names |= {name.id for name in node.targets if isinstance(name, ast.Name)}
        for node in ast.walk(scope):
            if not isinstance(node, ast.Compare):
                continue
            sides = [node.left, *node.comparators]
            numbers = [side.value for side in sides if isinstance(side, ast.Constant)]
            small = [n for n in numbers if isinstance(n, int | float) and 0 < n < LEAST_S]
            if small and any(is_measured(side, names) for side in sides):
                yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize(
    ("body", "found"),
    [
        ("s = time.monotonic()\n wait()\n assert time.monotonic() - s < 0.5", True),
        ("s = time.perf_counter()\n took = time.perf_counter() - s\n assert 2 >= took", True),
        ("s = time.monotonic()\n assert time.monotonic() - s < 5.0", False),
        ("s = clock.now_s()\n assert clock.now_s() - s < 0.5", False),
    ],
)
def test_it_finds_what_is_judged_in_haste(body: str, found: bool) -> None:
    assert bool(list(hasty(f"def test():\n {body}"))) is found


def test_no_measured_time_is_compared_with_less_than_five_seconds() -> None:
    faults = [
        f"{path.relative_to(TESTS)}: {fault}"
        for path in sorted(TESTS.rglob("test_*.py"))
        for fault in hasty(path.read_text())
    ]
    assert faults == [], "speed is for `drivelesson bench`: it reports, and judges nothing"
