"""Adds the page's own tests, which run in node, to the suite."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent
IN_CI = os.environ.get("CI") == "true"


@pytest.fixture
def node() -> str:
    found = shutil.which("node")
    if found is None and IN_CI:
        pytest.fail("CI needs node: apt-get install nodejs")
    if found is None:
        pytest.skip("NODE IS MISSING: the page's own tests did not run (apt-get install nodejs)")
    return found


def test_the_pages_tests_pass_in_node(node: str) -> None:
    files = sorted(str(path) for path in HERE.glob("*.test.mjs"))
    ran = subprocess.run(
        [node, "--test", *files],
        capture_output=True,
        text=True,
        timeout=280,
        env={**os.environ, "PYTHON": sys.executable},
    )
    assert ran.returncode == 0, _failures(ran.stdout) + ran.stderr


def _failures(tap: str) -> str:
    """Return the failed tests of a report in the format TAP, or the whole report if none failed."""
    return "\n".join(re.findall(r"^ *not ok .*?^ *\.\.\.$", tap, re.MULTILINE | re.DOTALL)) or tap


def test_the_page_is_well_typed(node: str, npm_modules: Path) -> None:
    tsc = npm_modules / "typescript" / "bin" / "tsc"
    command = [node, str(tsc), "--project", str(HERE / "tsconfig.json")]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=280)
    assert ran.returncode == 0, ran.stdout
