"""A client runs the tutorial's loop on Windows: it teaches, lets the robot drive, and restarts."""

from __future__ import annotations

import contextlib
import re
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import httpx

from robot.recordings.summary import read_summary
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from tests.robot.exchange.sim_drive import drive_in_simulator
from tests.server.live_robot import Pilot

from .console import Console
from .python_for_windows import ROOT, environment, python
from .readings import digest

LESSONS = 250
NEAR_M, FREE_M = 0.35, 0.8
ALONE_S = 20.0
PATIENCE_S = 240.0


def run(folder: Path) -> None:
    """Raise AssertionError if Windows differs from Linux."""
    data = folder / "data"
    with _served(data) as (console, address):
        taught = _teach(address)
        alone_s = _hand_over(address)
        _a_port_is_for_one(folder, address)
        taught_in_all = _lessons(address)
        status = console.press_ctrl_c()
    assert status in (0, 130), f"Ctrl-C ended it with {status}: {console.said[-2000:]!r}"
    print(f"taught {taught} examples; the robot drove {alone_s:.0f} s by itself until Ctrl-C")
    (name,) = ModelStore(Storage(data)).names()
    assert ModelStore(Storage(data)).load(name).summary.n_examples == taught_in_all

    with _served(data) as (console, address):
        assert _lessons(address) == taught_in_all, "the restarted program has all examples"
        more = _teach(address, taught_in_all + 30)
        console.close()
    with _served(data) as (console, address):
        assert _lessons(address) >= more, "a closed window loses no example"
        console.press_ctrl_c()
    print(f"a closed window lost nothing: {more} examples were restored")
    _recordings_are_the_same(folder, data)


def _recordings_are_the_same(folder: Path, data: Path) -> None:
    paths = sorted(data.glob("episodes/*.mcap"))
    assert paths and read_summary(paths[0]).damage is None
    here_made = folder / "here"
    here_made.mkdir()
    paths.append(drive_in_simulator(here_made, "default-32").path)
    command = python("-m", "tests.windows.readings", *map(windows_path, paths))
    there = subprocess.run(command, capture_output=True, text=True, env=environment(), cwd=ROOT)
    here = [digest(path) for path in paths]
    assert there.stdout.split("\n")[: len(here)] == here, (there.stdout, there.stderr, here)
    print("these recordings read the same on both systems:", *here, sep="\n  ")


def windows_path(path: Path) -> str:
    """Return a path as Wine shows it to Windows' programs."""
    return "Z:" + str(path.resolve()).replace("/", "\\")


@contextlib.contextmanager
def _served(data: Path) -> Iterator[tuple[Console, str]]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    data.mkdir(exist_ok=True)
    words = ["-m", "server", "--port", str(port), "--no-page", "--data", windows_path(data)]
    with Console(data.parent, *words) as console:
        end_s = time.monotonic() + PATIENCE_S
        while True:
            with contextlib.suppress(httpx.TransportError):
                assert httpx.get(address + "/healthz", timeout=10).status_code == 200
                break
            assert console.process.poll() is None and time.monotonic() < end_s, console.said
            time.sleep(0.5)
        page = httpx.get(address + "/", timeout=60).text
        files = re.findall(r"[\w/-]+\.(?:js|css)\b", page)
        assert "<html" in page and len(files) > 3
        for file in files:
            assert httpx.get(f"{address}/{file}", timeout=60).status_code == 200, file
        yield console, address


def _teach(address: str, lessons: int = LESSONS) -> int:
    """Drive like a pupil who turns left before walls; return the number of examples."""
    with contextlib.closing(_pilot(address)) as pilot:
        end_s, held = time.monotonic() + PATIENCE_S, "forward"
        while pilot.state["lessons"] < lessons:
            assert time.monotonic() < end_s, pilot.state
            if pilot.state["mode"] != "train":
                pilot.mode("train")
            distance_m = pilot.state["distance_m"] or 9.0
            is_left = distance_m < (FREE_M if held == "left" else NEAR_M)
            held = "left" if is_left else "forward"
            pilot.hold(held)
            time.sleep(0.05)
        pilot.hold(None)
        pilot.mode("stopped")
        return int(pilot.wait_for_state(mode="stopped")["lessons"])


def _hand_over(address: str) -> float:
    """Let the robot drive by itself for long enough; return the time."""
    with contextlib.closing(_pilot(address)) as pilot:
        alone_s, end_s = 0.0, time.monotonic() + PATIENCE_S
        while alone_s < ALONE_S:
            assert time.monotonic() < end_s, f"only {alone_s:.0f} s by itself: {pilot.state}"
            if pilot.state["mode"] != "autonomous":
                pilot.mode("autonomous")
            began_s = time.monotonic()
            time.sleep(0.1)
            state = pilot.state
            if state["driven_by"] == "robot" and state["action"] not in (None, "stop"):
                alone_s += time.monotonic() - began_s
        pilot.mode("stopped")
        pilot.wait_for_state(mode="stopped")
        return alone_s


def _a_port_is_for_one(folder: Path, address: str) -> None:
    port = address.rsplit(":", 1)[1]
    words = ["--port", port, "--data", windows_path(folder / "other")]
    second = subprocess.run(
        python("-m", "server", *words), capture_output=True, env=environment(), timeout=PATIENCE_S
    )
    assert second.returncode == 1 and b"cannot serve on" in second.stderr, second


def _lessons(address: str) -> int:
    with contextlib.closing(_pilot(address)) as pilot:
        return int(pilot.state["lessons"])


def _pilot(address: str) -> Pilot:
    pilot = Pilot(address.replace("http", "ws") + "/ws/drive", sees=True)
    pilot.wait_for(lambda message: message["type"] == "state")
    return pilot
