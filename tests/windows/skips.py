"""A plugin of `make test-windows`, which skips tests of functions that Windows lacks."""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from robot.errors import MissingExtraError

KERNEL = "only Linux has this kernel interface: "
RIGHTS = "Windows has no permission bits"
ITSELF = "server/test_damaged_folder.py::test_the_data_folder_itself_may_be_something_else"
LINKS = "few Windows accounts may make symbolic links"
NO_EXTRA = "the extra `{}` is not installed on Windows"
EXTRA_LIBRARIES = ("sklearn", "scipy", "matplotlib", "river", "pyarrow", "av")
"""Modules that tests import directly; the product's errors name other missing modules."""
SKIPPED = {
    "robot/bodies/gpio": KERNEL + "GPIO",
    "robot/bodies/ev3/test_v4l2.py": KERNEL + "V4L2",
    "server/board/test_classroom.py::test_a_key_is_made_once": RIGHTS,
    "server/access/test_security.py::test_pairings_outlive_a_restart": RIGHTS,
    **dict.fromkeys(
        [
            "robot/exchange/test_exports.py",
            "robot/exchange/test_lerobot.py",
        ],
        NO_EXTRA.format("export"),
    ),
    "server/exchange/test_in_and_out.py::test_films_and_datasets": NO_EXTRA.format("export"),
    **dict.fromkeys([f"{ITSELF}[{kind}" for kind in ("dangling", "loop")], LINKS),
    "server/access/test_unpaired_flood.py::test_a_flood": KERNEL + "a limit of descriptors",
    "robot/lab/test_evaluation.py::test_the_command_writes": NO_EXTRA.format("evaluate"),
    "robot/bodies/ev3/test_agent_process.py": "Windows does not have the brick's Python",
    "robot/bodies/ev3/test_installer.py": "the stand-in for ssh is a shell script",
    "robot/bodies/ev3/test_stock.py::test_the_cable_carries": KERNEL + "packets of a local socket",
}
ABSENT = {"mkfifo": KERNEL + "the named pipes of a simulated brick"}
"""Functions of `os`; a test that calls one of them is skipped on Windows."""
TESTS = Path(__file__).parents[1]


class _Skipped(pytest.Module):
    reason = ""

    def collect(self):
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


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Generator[None, Any, Any]:
    return (yield from _without_extras())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, Any, Any]:
    return (yield from _without_extras())


def _without_extras() -> Generator[None, Any, Any]:
    """Skip a test if an extra's library is missing."""
    try:
        return (yield)
    except MissingExtraError as error:
        pytest.skip(NO_EXTRA.format(error.extra))
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in EXTRA_LIBRARIES:
            raise
        pytest.skip(f"{error.name} is not installed on Windows")
