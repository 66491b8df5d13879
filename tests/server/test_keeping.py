"""However a real process ends, the next start has everything that was taught.

test_damaged_folder.py tests other damage to a folder.
"""

import os
import signal
import sys
import time
from pathlib import Path

import httpx
import pytest

from robot.recordings.summary import read_summary
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from tests.kit.run import run
from tests.kit.served import Served, served
from tests.kit.sizes import IS_FULL
from tests.robot.store.models.test_journal import check_a_disk_whose_flush_hangs_delays_no_record

from .live_robot import Pilot

NOT_OURS = "\udcff\udcfe"
"""A file name that is not UTF-8: the bytes FF FE."""
MOVED = ("models", "episodes", "trash", "robot.json", ".lock.pid")


def teach(server: Served, lessons: int) -> int:
    """Hold a move until this number of examples was added; return the number before."""
    with Pilot(server.drive_url) as pilot:
        before = int(pilot.wait_for_state()["lessons"])
        pilot.drive_until(lambda: pilot.state["lessons"] >= before + lessons, held="left")
        pilot.mode("stopped")
        pilot.wait_for_state(mode="stopped")
        time.sleep(0.2)
        return before


@pytest.mark.slow
@pytest.mark.realtime
def test_taught_examples_survive_every_kind_of_end(tmp_path, monkeypatch):
    folder = tmp_path / "data"
    if os.name != "nt":  # Windows has no named pipes
        ruin(folder)
    with served(folder, "--name", "sim") as server:
        if os.name != "nt":
            the_server_reports_moved_files_and_serves(server, folder)
        a_second_server_does_not_touch_the_folder_of_the_first(server, folder)
        assert teach(server, 5) == 0
        server.process.kill()
    ends = [signal.SIGTERM, signal.SIGINT]
    # SIGHUP is ignored if `nohup` runs this test
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        ends.append(signal.SIGHUP)  # like a terminal window that is closed
    for end in ends if IS_FULL else ends[:1]:
        the_server_saves_all_at_its_end_and_continues_from_there(folder, end)
    (tmp_path / "hung").mkdir()
    check_a_disk_whose_flush_hangs_delays_no_record(tmp_path / "hung", monkeypatch)


def ruin(folder: Path) -> None:
    folder.mkdir()
    (folder / "models").symlink_to(folder / "models")
    os.mkfifo(folder / "episodes")
    (folder / "trash").write_bytes(b"\xff")
    (folder / "robot.json").mkdir()
    os.mkfifo(folder / ".lock.pid")
    (folder / NOT_OURS).write_bytes(b"x")


def the_server_reports_moved_files_and_serves(server: Served, folder: Path) -> None:
    assert httpx.get(server.address + "/healthz").status_code == 200
    assert httpx.get(server.address + "/api/models").json()["models"] == []
    assert httpx.get(server.address + "/api/episodes").json()["episodes"] == []
    assert httpx.get(server.address + "/").status_code == 200
    [line] = [line for line in server.errors if "set aside" in line]
    for name in MOVED:
        assert name in line and f"set-aside/{name}.1" in line
    assert (folder / NOT_OURS).read_bytes() == b"x", "unknown files stay"


def a_second_server_does_not_touch_the_folder_of_the_first(first: Served, folder: Path) -> None:
    second = run(sys.executable, "-m", "server", "--port", "0", "--data", folder, timeout=60)
    assert second.returncode == 1
    assert f"process {first.process.pid}" in second.stderr and "--data" in second.stderr
    assert len(second.stderr.strip().splitlines()) == 1


def the_server_saves_all_at_its_end_and_continues_from_there(
    folder: Path, end: signal.Signals
) -> None:
    """The server's end does not wait for unfinished requests."""
    with served(folder, "--name", "sim") as server:
        before = teach(server, 20)
        with server.unfinished():
            server.process.send_signal(end)
            assert server.process.wait(60) in (0, 130)
    assert "Traceback" not in "".join(server.errors), "ending the server is not an error"
    model = ModelStore(Storage(folder)).load("sim")
    assert model.summary.n_examples >= before + 20
    ours = [path for path in folder.rglob("*") if path.is_file() and path.name != NOT_OURS]
    readable = [path for path in ours if path.stat().st_mode & 0o077]
    assert os.name == "nt" or {path.parent.name for path in readable} <= {"set-aside"}
    path = max(folder.glob("episodes/*.mcap"), key=lambda path: path.stat().st_mtime)
    summary = read_summary(path)
    taught = sum(summary.taught.values())
    assert summary.damage is None and before + taught == model.summary.n_examples
    with served(folder, "--robot", "replay", "--episode", str(path)) as server:
        listed = httpx.get(f"{server.address}/api/models", timeout=60).json()
        assert listed["current"] == "sim"
        assert listed["models"][0]["lessons"] == model.summary.n_examples
