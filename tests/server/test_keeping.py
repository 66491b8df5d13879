"""However a real process ends, everything that was taught is there again at the next start.

test_damaged_folder.py tests other damage to a folder.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from robot.recordings.summary import read_summary
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from tests.kit.sizes import IS_FULL
from tests.robot.store.models.test_journal import check_a_disk_whose_flush_hangs_holds_up_no_record

from .live_robot import Pilot
from .own_process import OwnProcess, own_process

pytestmark = pytest.mark.realtime


def teach(server: OwnProcess, lessons: int) -> int:
    """Hold a move until this number of examples was taught; return the final number."""
    with Pilot(f"ws://127.0.0.1:{server.port}/ws/drive") as pilot:
        pilot.drive_until(lambda: pilot.state["lessons"] >= lessons, held="left")
        pilot.mode("stopped")
        pilot.wait_for_state(mode="stopped")
        time.sleep(0.2)
        return int(pilot.state["lessons"])


@pytest.mark.slow
def test_taught_examples_survive_every_kind_of_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    a_second_server_leaves_the_folder_of_the_first_alone(tmp_path / "shared")
    ends = [signal.SIGTERM, signal.SIGINT]
    # if SIGHUP is ignored, `nohup` runs this test
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        ends.append(signal.SIGHUP)  # as if a terminal's window was closed
    for end in ends if IS_FULL else ends[:1]:
        it_ends_with_everything_saved_and_goes_on_from_there(tmp_path / end.name, end)
    it_starts_on_a_ruin_and_says_what_it_moved(tmp_path / "ruin")
    (tmp_path / "hung").mkdir()
    check_a_disk_whose_flush_hangs_holds_up_no_record(tmp_path / "hung", monkeypatch)


def a_second_server_leaves_the_folder_of_the_first_alone(folder: Path) -> None:
    with own_process(folder) as first:
        words = [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(folder)]
        second = subprocess.run(words, capture_output=True, text=True, timeout=60)
        assert second.returncode == 1
        assert f"process {first.process.pid}" in second.stderr and "--data" in second.stderr
        assert len(second.stderr.strip().splitlines()) == 1
        assert teach(first, 5) >= 5
        first.process.kill()
    with own_process(folder) as after_a_kill:
        assert httpx.get(after_a_kill.address + "/healthz").status_code == 200


def it_ends_with_everything_saved_and_goes_on_from_there(folder: Path, end: signal.Signals) -> None:
    with own_process(folder, "--name", "sim") as server:
        taught = teach(server, 20)
        server.process.send_signal(end)
        assert server.process.wait(60) in (0, 130)
    assert "Traceback" not in "".join(server.errors), "its end is no error"
    model = ModelStore(Storage(folder)).load("sim")
    assert model.summary.n_examples >= taught
    readable = [path for path in folder.rglob("*") if path.stat().st_mode & 0o077]
    assert os.name == "nt" or not any(path.is_file() for path in readable), "its owner's only"
    [path] = folder.glob("episodes/*.mcap")
    summary = read_summary(path)
    assert summary.damage is None and sum(summary.taught.values()) == model.summary.n_examples
    with own_process(folder, "--robot", "replay", "--episode", str(path)) as server:
        listed = httpx.get(f"{server.address}/api/models", timeout=60).json()
        assert listed["current"] == "sim"
        assert listed["models"][0]["lessons"] == model.summary.n_examples


def it_starts_on_a_ruin_and_says_what_it_moved(folder: Path) -> None:
    root = folder / "data"
    root.mkdir(parents=True)
    (root / "models").symlink_to(root / "models")
    os.mkfifo(root / "episodes")
    (root / "trash").write_bytes(b"\xff")
    (root / "robot.json").mkdir()
    os.mkfifo(root / ".lock.pid")
    not_ours = Path(os.fsdecode(os.fsencode(root) + b"/\xff\xfe"))
    not_ours.write_bytes(b"x")
    with own_process(root) as server:
        assert httpx.get(server.address + "/healthz").status_code == 200
        assert httpx.get(server.address + "/api/models").json()["models"] == []
        assert httpx.get(server.address + "/api/episodes").json()["episodes"] == []
        assert httpx.get(server.address + "/").status_code == 200
    lines = [line for line in server.errors if "set aside" in line]
    assert len(lines) == 1
    for name in ("models", "episodes", "trash", "robot.json", ".lock.pid"):
        assert name in lines[0] and f"set-aside/{name}.1" in lines[0]
    assert not_ours.read_bytes() == b"x", "a name that the server does not know stays"
