"""No test compares a time measured on the machine's clock with less than five seconds."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

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


def test_no_measured_time_is_compared_with_less_than_five_seconds() -> None:
    is_found = "def test():\n s = time.time()\n took = time.time() - s\n assert 2 >= took"
    assert [*hasty(is_found)] and not [*hasty(is_found.replace("2", "5.0"))]
    faults = [
        f"{path.relative_to(TESTS)}: {fault}"
        for path in sorted(TESTS.rglob("test_*.py"))
        for fault in hasty(path.read_text())
    ]
    assert faults == [], "speed is for `drivelesson bench`: it reports, and judges nothing"
