"""Robots forked from one process: each can end separately, and all end with the class."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

pytest.importorskip("panda3d")

from server.board.nursery import Nursery

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks"),
]


def test_each_robot_can_end_separately_and_all_end_with_the_class(tmp_path: Path) -> None:
    nursery = Nursery(tmp_path, "box")
    assert nursery.picture_s is not None and 0 < nursery.picture_s < 1

    mistaken = nursery.start(["--robot", "nobody"], tmp_path / "log.txt")
    assert mistaken is not None and mistaken.wait()
    assert "unknown robot 'nobody'" in (tmp_path / "log.txt").read_text()

    common = ["--port", "0", "--no-page", "--data"]
    killed, stays = (
        nursery.start([*common, str(tmp_path / name)], tmp_path / f"{name}.txt")
        for name in ("one", "two")
    )
    assert killed is not None and stays is not None
    _, pid, other = nursery._ended
    os.kill(pid, signal.SIGKILL)
    assert killed.wait() and not stays.is_set()

    nursery.end()
    nursery.wait()
    assert stays.wait()
    with pytest.raises(ProcessLookupError):
        os.kill(other, 0)
