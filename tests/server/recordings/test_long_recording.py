"""After a power cut at the end of a long drive the server is ready soon, and its list is short.

`DRIVELESSON_MINUTES` sets the length of the drive (an hour: 60). With -s the test prints the times.
"""

from __future__ import annotations

import os
import random
import time
from pathlib import Path

import httpx
import pytest

from robot.store.folder import Storage
from robot.store.models import journal
from tests.kit.sizes import IS_FULL, size
from tests.kit.wait import wait_until
from tests.robot.recordings.long_recording import write_cut_recording
from tests.robot.store.models.lives import Life
from tests.server.own_process import own_process

MINUTES = size("MINUTES", 1, 2)
pytestmark = [pytest.mark.realtime, pytest.mark.slow]


def fill_journal(folder: Path) -> int:
    """Teach without saving until the journal's last part has its maximum length."""
    life = Life(folder, [0.0], random.Random(1), "default-32")
    while life.journal._writer is None or life.journal._writer.written_bytes < (
        journal.PART_BYTES if MINUTES >= 60 else journal.PART_BYTES // (2 if IS_FULL else 8)
    ):
        life.teach()
        life.write()
    life.die()
    return sum(life.loop.state.taught.values())


def server_cpu_s(pid: int) -> float:
    """Return the CPU time that a process has used."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def test_after_an_hour_that_was_cut_short_it_is_ready_and_its_list_small(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_cut_recording(
        Storage(tmp_path).folder("episodes") / "2026-01-01_100000_000.mcap", minutes=MINUTES
    )
    cut, taught = path.stat().st_ino, fill_journal(tmp_path)
    started_s = time.monotonic()
    with own_process(tmp_path) as server:
        assert httpx.get(server.address + "/healthz", timeout=60).status_code == 200
        ready_s, ready_cpu_s = time.monotonic() - started_s, server_cpu_s(server.process.pid)
        state = httpx.get(server.address + "/api/teaching", timeout=60).json()
        wait_until(lambda: path.stat().st_ino != cut, "it is replaced by a whole one", 600)
        asked_s = time.monotonic()
        [listed] = httpx.get(server.address + "/api/episodes", timeout=60).json()["episodes"]
        list_s = time.monotonic() - asked_s
        ended_s = asked_s - started_s
        status = Path(f"/proc/{server.process.pid}/status").read_text()
        peak_mb = int(status.split("VmHWM:")[1].split()[0]) / 1024
    with capsys.disabled():
        print(
            f"\n{MINUTES:.0f} minutes, {path.stat().st_size / 1e6:.0f} MB, {taught} examples in the"
            f" journal: ready in {ready_s:.2f} s ({ready_cpu_s:.2f} s of CPU)"
            f", ended after {ended_s:.2f} s, listed in {list_s:.2f} s, peak {peak_mb:.0f} MB"
        )
    assert state["lessons"] == taught
    assert listed["frames"] > MINUTES * 60 * 30 * 0.9 and listed["damage"]
    assert peak_mb < 300
