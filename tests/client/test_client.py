"""A few lives of the random client; `python -m tests.client` runs longer."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.kit.sizes import size

STEPS = size("CLIENT_STEPS", 300, 4000)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="each life is a forked process")
@pytest.mark.parametrize("seed", range(size("CLIENT_SEEDS", 1, 3)))
def test_no_answered_change_is_lost_and_no_robot_moves_without_a_pilot(seed: int) -> None:
    words = ["-m", "tests.client", "--steps", str(STEPS), "--kills", str(STEPS // 75)]
    ran = subprocess.run(
        [sys.executable, *words, "--seed", str(seed)], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "violations 0" in ran.stdout
