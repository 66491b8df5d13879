"""A run with too many real-time tests ends with a sentence, in workers, too."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.sizes import in_ci
from tests.wall_clock import MOST

MANY = f"""
import pytest

@pytest.mark.realtime
@pytest.mark.parametrize("n", range({MOST} + 1))
def test_of_many(n):
    raise AssertionError("it ran")
"""


@pytest.mark.parametrize(
    "workers",
    [
        pytest.param((), id="alone"),
        pytest.param(("-p", "xdist", "-n", "2"), id="workers", marks=in_ci),
    ],
)
def test_too_many_tests_that_wait_for_real_end_the_run_with_a_sentence(
    tmp_path: Path, workers: tuple[str, ...]
) -> None:
    (tmp_path / "test_many.py").write_text(MANY)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    realtime\n    slow\n")
    with_ours = ("-c", tmp_path / "pytest.ini", "-p", "tests.conftest")
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", *with_ours, *workers, tmp_path],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    said = ran.stdout + ran.stderr
    assert f"{MOST + 1} tests are marked `realtime`, and at most {MOST} may be: give one" in said
    assert f"test_of_many[{MOST}]" in said
    assert ran.returncode in (pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED), said
    assert "INTERNALERROR" not in said and "it ran" not in said, said
