"""Kills at random moments: recordings are complete up to the last flush, and the learner continues.

Virtual time checks how much a kill may cost (test_recorder.py). CI kills 200 times (a bit over two
minutes).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.sizes import size

from .power_cut import Life

pytestmark = pytest.mark.realtime

KILLS = size("KILLS", 6, 200)


CHAINS = 2
"""Number of robots that run at the same time, because a life consists mostly of waiting."""


@pytest.mark.slow
@pytest.mark.timeout(240 + 3 * KILLS)
@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked here")
def test_a_power_cut_leaves_whole_recordings_and_undoes_no_undo(tmp_path: Path) -> None:
    root = Path(__file__).parents[4]
    running = []
    for chain in range(CHAINS):
        folder = tmp_path / str(chain)
        folder.mkdir()
        words = [str(folder), str(KILLS // CHAINS), str(1 + chain)]
        command = [sys.executable, "-m", "tests.robot.recordings.power_cut", *words]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        running.append(subprocess.Popen(command, text=True, cwd=root, **pipes))
    chains = []
    for process in running:
        said, errors = process.communicate()
        assert process.returncode == 0, errors[-2000:]
        chains.append([Life(**life) for life in json.loads(said)])
    lives = [life for chain in chains for life in chain]
    assert len(lives) == KILLS // CHAINS * CHAINS
    assert [life.failure for life in lives if life.failure] == []
    assert sum(life.taught_on_disk for life in lives) > 0
    for chain in chains:
        check_what_is_known(chain)


def check_what_is_known(lives: list[Life]) -> None:
    """Each life must begin with what earlier lives had in the journal, or had learned since."""
    possible = {0}
    for life in lives:
        if life.loaded is not None:
            assert life.loaded in possible, "lost, or an undo came undone"
            possible = {life.loaded}
        since = set(life.told[max(0, life.kept - 1) :])
        possible = since if life.kept else possible | since
