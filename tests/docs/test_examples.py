"""The examples in the README, in the how-to about the library, and in docstrings run as written."""

from __future__ import annotations

import doctest
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
def test_the_examples_of_a_docstring_are_true(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def printed(page: Path) -> tuple[str, list[str]]:
    """Run the code of a page; return the code, and the lines that it prints."""
    code = "\n".join(re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL))
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    return code, done.stdout.splitlines()


def test_the_readme_prints_what_it_says() -> None:
    code, lines = printed(ROOT / "README.md")
    assert lines == re.findall(r"# (\w+)$", code, re.MULTILINE) == ["left"]


def test_the_how_to_prints_what_it_says() -> None:
    page = ROOT / "docs/howto/use-from-python.md"
    said = re.findall(r"The example prints (.*?)\.(?: |\n)", page.read_text("utf-8"), re.DOTALL)
    promised = [line for sentence in said for line in re.findall(r"`([^`]+)`", sentence)]
    assert promised and printed(page)[1] == promised
