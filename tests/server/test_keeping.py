"""A real process: what it was taught is there again, however it ended."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from robot.episodes.summary import read_summary
from robot.models.store import ModelStore
from robot.storage.folder import Storage

from .live_robot import Pilot

pytestmark = pytest.mark.realtime


@contextmanager
def serving(data: Path, *words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    command = [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(data)]
    root = Path(__file__).parents[2]
    process = subprocess.Popen([*command, *words], stdout=subprocess.PIPE, text=True, cwd=root)
    try:
        assert process.stdout is not None
        lines = iter(process.stdout.readline, "")
        address = next(w for line in lines for w in line.split() if w.startswith("http://"))
        yield process, address.rstrip("/")
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def teach(address: str, lessons: int) -> int:
    """Hold a move until so many examples were taught; return how many there were in the end."""
    with Pilot(address.replace("http", "ws") + "/ws/drive") as pilot:
        pilot.drive_until(lambda: pilot.state["lessons"] >= lessons, held="left")
        pilot.mode("stopped")
        pilot.wait_for_state(mode="stopped")
        time.sleep(0.2)
        return int(pilot.state["lessons"])


@pytest.mark.slow
def test_a_second_server_leaves_the_folder_of_the_first_alone(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(tmp_path)]
    with serving(tmp_path, "--robot", "sim") as (process, address):
        second = subprocess.run(words, capture_output=True, text=True, timeout=60)
        assert second.returncode == 1
        assert f"process {process.pid}" in second.stderr and "--data" in second.stderr
        assert len(second.stderr.strip().splitlines()) == 1
        assert teach(address, 5) >= 5
    with serving(tmp_path, "--robot", "sim") as (_, address):  # the first was killed
        assert httpx.get(address + "/healthz").status_code == 200


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_with_everything_saved_and_goes_on_from_there(tmp_path: Path, end: int) -> None:
    with serving(tmp_path, "--robot", "sim", "--name", "sim") as (process, address):
        taught = teach(address, 20)
        process.send_signal(end)
        assert process.wait(60) in (0, 130)
    model = ModelStore(Storage(tmp_path)).load("sim")
    assert model.summary.n_examples >= taught
    [path] = tmp_path.glob("episodes/*.mcap")
    summary = read_summary(path)
    assert summary.damage is None and sum(summary.taught.values()) == model.summary.n_examples

    with serving(tmp_path, "--robot", "replay", "--episode", str(path)) as (_, address):
        listed = httpx.get(f"{address}/api/models", timeout=60).json()
        assert listed["current"] == "sim"
        assert listed["models"][0]["lessons"] == model.summary.n_examples
