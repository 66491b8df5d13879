"""Skips on Windows what no Windows has, each with its reason: a plugin of `make test-windows`."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

KERNEL = "a kernel's interface that Linux alone has: "
RIGHTS = "who may read a file is not said by bits there"
NO_EXTRA = "the extra `export` is not installed there (pyarrow, av)"
SKIPPED = {
    "robot/bodies/gpio": KERNEL + "GPIO",
    "robot/bodies/ev3/test_v4l2.py": KERNEL + "V4L2",
    "server/test_hostile.py": KERNEL + "the memory that a process takes",
    "robot/store/episodes/test_hostile.py": KERNEL + "limits of memory",
    "server/board/test_classroom.py::test_a_key_is_made_once": RIGHTS,
    "server/test_security.py::test_pairings_outlive_a_restart": RIGHTS,
    **dict.fromkeys(
        [
            "robot/exchange/test_exports.py",
            "robot/exchange/test_lerobot_in.py",
            "robot/exchange/test_own_moves.py",
            "robot/exchange/test_timeline.py",
        ],
        NO_EXTRA,
    ),
}
ABSENT = {"mkfifo": KERNEL + "named pipes, which a stand-in for a brick has"}
"""Functions of `os`: a test that calls one is skipped there."""
TESTS = Path(__file__).parents[1]


class _Skipped(pytest.Module):
    reason = ""

    def collect(self):  # type: ignore[no-untyped-def]
        pytest.skip(self.reason, allow_module_level=True)


def _reason(path: Path, name: str = "") -> str | None:
    place = f"{path.relative_to(TESTS).as_posix()}::{name}"
    return next((why for start, why in SKIPPED.items() if place.startswith(start)), None)


def pytest_pycollect_makemodule(
    module_path: Path, parent: pytest.Collector
) -> pytest.Module | None:
    if (reason := _reason(module_path)) is None:
        return None
    module = _Skipped.from_parent(parent, path=module_path)
    module.reason = reason
    return module


def pytest_configure() -> None:
    for name, reason in ABSENT.items():
        setattr(os, name, lambda *_, reason=reason: pytest.skip(reason))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if reason := _reason(item.path, item.name):
            item.add_marker(pytest.mark.skip(reason))
