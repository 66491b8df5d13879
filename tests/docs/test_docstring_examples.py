"""The examples in the docstrings of the public API run as they are written."""

from __future__ import annotations

import doctest
import importlib

import pytest

MODULES = (
    "robot",
    "robot.camera",
    "robot.driver",
    "robot.moves",
    "robot.learner",
    "robot.learner.classifier",
    "robot.testing.camera",
    "robot.testing.driver",
    "robot.testing.virtual_clock",
    "robot.testing.world",
)


@pytest.mark.parametrize("name", MODULES)
def test_examples(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0
