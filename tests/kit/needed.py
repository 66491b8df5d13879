"""Skips tests that need software that a machine may lack; CI has all of it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NoReturn

import pytest

ROOT = Path(__file__).parents[2]


def missing(what: str, how: str) -> NoReturn:
    """Skip the test and show why; in CI, the test fails instead."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"CI needs {what}: {how}")
    pytest.skip(f"{what.upper()} IS MISSING: {how}")


def installed(name: str, package: str, options: str = "") -> Path:
    """Return the folder of a third-party package that CI installs only for the tests."""
    folder = ROOT / "var" / name
    if not (folder / package).is_dir():
        missing(name, f"pip install {options}--target var/{name} {name}")
    return folder
