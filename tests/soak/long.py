"""Uses a recording of some hours while its robot is taught, and reports: outside CI.

`python -m tests.soak.long --pictures 200000`: makes two drives, one of 2,000 pictures and a long
one (or takes those in `--folder`), and reports the peak memory of exports and of learning again for
both. Then it serves a simulated robot and teaches it, first undisturbed, then while clients open
the long drive's page, edit it, download it and learn from it again: time and memory of the page,
lessons per second, stops, and the time from an order to its effect. At last it sends SIGTERM while
the recording is being read. All ratios hold on a busy machine; the times need an idle machine.
"""

from __future__ import annotations

import argparse
import contextlib
import http.client
import json
import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from robot.recordings.config import RecorderConfig
from robot.recordings.messages import Topic
from robot.recordings.open_recording import OpenRecording
from robot.recordings.recorder import RecordingQueue
from robot.recordings.writer import describe_run
from robot.store.disk import no_announcement
from robot.testing import VirtualClock
from robot.types import DEFAULT_MOVES
from tests.kit.frames import jpeg_frame
from tests.server.live_robot import Pilot
from tests.soak.served import Served

RATE_HZ = 30
NAME = "2026-01-01_100000_000"
_SHORT = 2000
_FORMS = ("npz", "tub", "lerobot", "folder")


def record(data: Path, pictures: int) -> None:
    """Record a drive that was taught with every picture, in parts, as a robot records it."""
    folder, clock = data / "episodes", VirtualClock()
    folder.mkdir(parents=True)
    seen = _scene()
    config = RecorderConfig(spare_bytes=0)
    recording = OpenRecording(folder, config, lambda path: path.open("xb"), no_announcement, clock)
    queue = RecordingQueue(recording, config)
    run = describe_run(
        episode_id=NAME,
        run_id="long",
        origin_ns=1_700_000_000 * 10**9,
        started_at_s=1.7e9,
        robot="sim",
        learner="default-32",
        moves=DEFAULT_MOVES,
    )
    queue.begin(run, None)
    decision = {"mode": "train", "driven_by": "pilot", "speed_scale": 1.0, "stop_reason": None}
    lesson = {"event": "taught", "intervention": False, "x": None}
    for number in range(1, pictures + 1):
        now_s, label = number / RATE_HZ, DEFAULT_MOVES[number // 40 % len(DEFAULT_MOVES)]
        queue.write_frame(jpeg_frame(number, now_s, seen[number % len(seen)]))
        pose = {"x_m": number % 100 / 50, "y_m": 1.0, "heading_rad": 0.3}
        said: dict[Topic, dict[str, Any]] = {
            Topic.SENSORS: {"distance_m": 0.5, "bumped": False, "battery": None, "pose": pose},
            Topic.PREDICTION: {"frame": number, "action": label, "confidence": 0.9},
            Topic.DECISION: decision | {"asks_pilot": False, "action": label, "sent": label},
            Topic.LESSON: lesson | {"frame": number, "label": label, "at_s": now_s},
        }
        queue.write_messages(now_s, lambda said=said: list(said.items()))
        if number % 6 == 0:
            clock.sleep(now_s - clock.now_s())
            queue.write_waiting()
    queue.end(None, is_kept=True)
    clock.sleep(1.0)
    queue.write_waiting()


def _scene() -> list[bytes]:
    """Return JPEGs of a road that turns."""
    chance, found = np.random.default_rng(1), []
    for turn in np.linspace(0, 2 * np.pi, 400):
        picture, x = np.full((120, 160, 3), 90, np.uint8), 80 + int(60 * np.sin(turn))
        cv2.line(picture, (x, 119), (160 - x, 50), (230, 230, 230), 7)
        noisy = picture.astype(int) + chance.integers(-6, 7, picture.shape)
        found.append(cv2.imencode(".jpg", noisy.clip(0, 255).astype(np.uint8))[1].tobytes())
    return found


def command(*words: str) -> tuple[float, float]:
    """Run a command of `drivelesson`; return its CPU time in seconds and its peak memory in MB."""
    process = subprocess.Popen(
        [sys.executable, "-m", "server", *words], stdout=subprocess.DEVNULL, env=os.environ
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(words)} failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def compare_commands(folder: Path, short: Path, long: Path, pictures: int) -> None:
    print(f"{'':24} {_SHORT:>9} {pictures:>9} pictures")
    out = folder / "out.npz"
    for form in (*_FORMS, "learn"):
        spent = []
        for data in (short, long):
            export = ("episodes", "export", NAME, "--as", form, "--out", str(out))
            words = ("learn", NAME) if form == "learn" else export
            spent.append(command(*words, "--data", str(data)))
            subprocess.run(["rm", "-rf", str(out)], check=True)
        (first_s, first_mb), (last_s, last_mb) = spent
        each_us = 1e6 * (last_s - first_s) / max(pictures - _SHORT, 1)
        grown = f"{first_mb:6.0f} MB {last_mb:6.0f} MB {last_mb - first_mb:+6.0f} MB"
        print(f"{form:24} {grown}, {each_us:.0f} us of CPU a picture", flush=True)


class Lessons:
    """A pilot who changes the move each half second for some seconds, and what came of it: lessons
    per second, stops, and the times until each change."""

    def __init__(self, pilot: Pilot, seconds: float) -> None:
        waited_s: list[float] = []
        began_s, before, turn, was_taught = time.monotonic(), _taught(pilot), 0, False
        self.stops = 0
        while time.monotonic() < began_s + seconds:
            if pilot.state["mode"] != "train":
                self.stops += was_taught
                was_taught = False
                pilot.mode("train")  # a busy machine stops the robot, as it must
                time.sleep(0.2)
                continue
            turn, was_taught, ordered_s = turn + 1, True, time.monotonic()
            pilot.hold(move := ("left", "right")[turn % 2])
            with contextlib.suppress(AssertionError):  # the robot stopped
                pilot.wait_for_state(2.0, action=move)
                waited_s.append(time.monotonic() - ordered_s)
            time.sleep(max(0.0, 0.5 - (time.monotonic() - ordered_s)))
            del pilot.messages[:-50]
        self.each_second = (_taught(pilot) - before) / (time.monotonic() - began_s)
        self.p95_s = float(np.quantile(waited_s, 0.95)) if waited_s else float("nan")


def _taught(pilot: Pilot) -> int:
    return sum(pilot.state["taught"].values())


class Reader:
    """A client that uses the long recording again and again. In the pilot's process it would delay
    the pilot, so it has a process of its own, with low priority: it stands for another computer."""

    def __init__(self, served: Served) -> None:
        self._served, self._base = served, f"{served.http}/api"
        self.times_s: dict[str, list[float]] = {}
        self.grown_mb = 0.0
        context = multiprocessing.get_context("fork")
        self.ending, self._told = context.Event(), context.SimpleQueue()
        self._process = context.Process(target=self._work, daemon=True)
        self._process.start()

    def end(self) -> None:
        """Let it end, and take its results."""
        self.ending.set()
        self.times_s, self.grown_mb = self._told.get()
        self._process.join()

    def _work(self) -> None:
        os.nice(19)
        try:
            self._use()
        finally:
            self._told.put((self.times_s, self.grown_mb))

    def _use(self) -> None:
        one = f"/episodes/{NAME}"
        edit = {"verb": "relabel", "first": 1000, "last": 2000, "label": "left"}
        before_mb = self._served.measure()["memory MB"]
        self._time("open", lambda: (self._ask(one), self._ask(f"{one}/timeline?count=600")))
        self.grown_mb = self._served.measure()["memory MB"] - before_mb
        while not self.ending.is_set():
            self._time("open again", lambda: self._ask(one))
            self._time("edit", lambda: self._ask(f"{one}/edits", edit))
            self._time("undo", lambda: self._ask(f"{one}/edits/last", method="DELETE"))
            self._time("download", lambda: self._read(f"{one}/file"))
            self._time("learn again", self._learn)

    def _time(self, name: str, act: Callable[[], object]) -> None:
        if self.ending.is_set() and name != "open":
            return
        began_s = time.monotonic()
        with contextlib.suppress(OSError, http.client.HTTPException):  # the server ended
            act()
            self.times_s.setdefault(name, []).append(time.monotonic() - began_s)

    def _learn(self) -> None:
        self._ask("/retraining", {"episodes": [NAME]})
        while not self.ending.wait(0.5) and self._ask("/retraining")["state"] == "running":
            pass
        self._ask("/retraining", method="DELETE")

    def _ask(self, path: str, body: object = None, method: str | None = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        headers = {"content-type": "application/json"}
        request = urllib.request.Request(self._base + path, data, headers, method=method)
        with urllib.request.urlopen(request, timeout=120) as answer:
            return json.load(answer)

    def _read(self, path: str) -> None:
        with urllib.request.urlopen(self._base + path, timeout=120) as answer:
            while not self.ending.is_set() and answer.read(1 << 18):
                pass


def teach_meanwhile(folder: Path, seconds: float) -> None:
    served = Served(folder, "--frame-rate-hz", str(RATE_HZ))
    with Pilot(served.drive, sees=True) as pilot:
        pilot.wait_for_state(60, you_are_pilot=True)
        quiet = Lessons(pilot, seconds)
        reader = Reader(served)
        busy = Lessons(pilot, seconds)
        peak_mb = served.peak_mb()
        ended_s = served.stop()  # while the recording is being read
        reader.end()
        for name, times_s in reader.times_s.items():
            print(f"{name:24} {max(times_s):6.2f} s at most, {len(times_s)} times")
        print(f"the page's memory        {reader.grown_mb:+6.1f} MB; peak of all {peak_mb:.0f} MB")
        for name, lessons in (("undisturbed", quiet), ("meanwhile", busy)):
            print(
                f"{name:24} {lessons.each_second:6.1f} lessons/s, {lessons.stops} stops, "
                f"order to effect p95 {1000 * lessons.p95_s:.0f} ms"
            )
        ratios = busy.each_second / quiet.each_second, busy.p95_s / quiet.p95_s
        print(f"{'ratio':24} {ratios[0]:6.2f} lessons/s, p95 {ratios[1]:.2f}", flush=True)
    print(f"SIGTERM while reading    {ended_s:6.2f} s")
    reasons = re.findall(r"stop reason=(\w+)", (folder / "log").read_text(errors="replace"))
    print(f"stops in the log: {', '.join(reasons) or 'none'}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=200_000)
    parser.add_argument("--seconds", type=float, default=30.0, help="of teaching, twice")
    parser.add_argument("--folder", type=Path, help="keep the recordings here, and use them again")
    parser.add_argument("--only", choices=("commands", "taught"))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        kept = args.folder or Path(name)
        short, long = kept / "short" / "data", kept / f"long-{args.pictures}" / "data"
        for data, pictures in ((short, _SHORT), (long, args.pictures)):
            if not data.exists():
                record(data, pictures)
        print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)
        if args.only != "taught":
            compare_commands(Path(name), short, long, args.pictures)
        if args.only != "commands":
            teach_meanwhile(long.parent, args.seconds)
        print(f"load {os.getloadavg()[0]:.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
