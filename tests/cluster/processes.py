"""Real schedulers, workers and clients in separate processes."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy

from tests.kit.ports import free_port

ROOT = Path(__file__).parents[2]
_SITE = Path(numpy.__file__).parents[1]
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
_OTHER_NUMPY = "2.2.6"
_MOST_S = 150.0


@dataclass
class Process:
    """A process that was started here."""

    popen: subprocess.Popen[Any]

    def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.popen.pid, signal.SIGKILL)
        self.popen.wait()

    def freeze(self) -> None:
        os.killpg(self.popen.pid, signal.SIGSTOP)


class Cluster:
    """A scheduler on a separate port, and the added workers."""

    def __init__(self, folder: Path, kind: str = "good") -> None:
        self._folder, self._kind = folder, kind
        self._port = free_port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._processes: list[Process] = []
        self._timers: list[threading.Timer] = []

    def __enter__(self) -> Self:
        args = ["dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port)]
        self._start(self._kind, *args, "--no-dashboard", "--no-show")
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._port)):
                return self
            time.sleep(0.1)

    def add(self, kind: str) -> Process:
        """Start a worker: good, threads, nanny, bare, changed, python, numpy or blas."""
        threads = "4" if kind == "threads" else "1"
        args = ["dask_worker", self.address, "--nthreads", threads, "--no-dashboard"]
        return self._start(kind, *args, *([] if kind == "nanny" else ["--no-nanny"]))

    def add_later(self, kind: str, seconds: float) -> None:
        timer = threading.Timer(seconds, self.add, [kind])
        timer.start()
        self._timers.append(timer)

    @property
    def pids(self) -> list[int]:
        """The ids of the processes: first the scheduler, then the workers."""
        return [process.popen.pid for process in self._processes]

    def kill_scheduler(self) -> None:
        self._processes[0].kill()

    def _start(self, kind: str, module: str, *args: str) -> Process:
        python, flags, path = sys.executable, [], [str(ROOT)]
        if kind in ("bare", "python"):
            flags, path = ["-S"], [str(_SITE)]
        if kind == "python":
            python, path = "/usr/bin/python3", [str(ROOT), str(_SITE)]
        elif kind == "changed":
            path = [str(self._changed())]
        elif kind == "numpy":
            path = [str(self._other_numpy()), *path]
        threads = dict.fromkeys(_ONE_THREAD, "2") if kind == "blas" else _ONE_THREAD
        with (self._folder / f"{kind}-{len(self._processes)}.log").open("wb") as log:
            popen = subprocess.Popen(
                [python, *flags, "-m", f"distributed.cli.{module}", *args],
                cwd=self._folder,
                env={**os.environ, **threads, "PYTHONPATH": os.pathsep.join(path)},
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        process = Process(popen)
        self._processes.append(process)
        return process

    def _changed(self) -> Path:
        """Copy the program, with one constant changed."""
        place = self._folder / "changed"
        if not place.exists():
            shutil.copytree(ROOT / "robot", place / "robot")
            file = place / "robot" / "policy" / "features.py"
            file.write_text(file.read_text("utf-8") + "\nCHANGED = 1\n", "utf-8")
        return place

    def _other_numpy(self) -> Path:
        place = self._folder / "numpy"
        install = [sys.executable, "-m", "pip", "install", "-q", "--target", str(place)]
        subprocess.run([*install, f"numpy=={_OTHER_NUMPY}"], check=True)
        return place

    def __exit__(self, *exc: object) -> None:
        for timer in self._timers:
            timer.cancel()
            timer.join()
        for process in reversed(self._processes):
            process.kill()


@dataclass
class Ended:
    """The end of a client."""

    code: int | None
    lines: list[str] = field(default_factory=list)
    seconds: float = 0.0
    silent_s: float = 0.0

    @property
    def results(self) -> str:
        return next((line for line in self.lines if line.startswith("results ")), "")

    def verdict(self, expected: str, alone: str) -> str:
        if self.code is None:
            return f"WRONG: it hung; {self.lines[-3:]}"
        if self.silent_s > 30.0:
            return f"WRONG: silent for {self.silent_s:.0f} s"
        if expected == "equal":
            is_equal = self.code == 0 and self.results == alone
            return "equal" if is_equal else f"WRONG: {self.code} {self.lines[-3:]}"
        said = self.lines[-1] if self.lines else ""
        if self.code == 0 or self.results or not re.search(expected, said):
            return f"WRONG: {self.code} {self.lines[-3:]}"
        if "Traceback" in "".join(self.lines) and "run " not in said:
            return f"WRONG: a traceback before: {said}"
        return f"said: {said[:150]}"


def run_client(
    folder: Path,
    scheduler: str,
    *,
    after_first: Callable[[], object] | None = None,
    on_done: Callable[[int], object] = lambda pid: None,
    most_s: float = _MOST_S,
    **options: str,
) -> Ended:
    """Run some short lessons in a separate process, and read its output.

    `on_done` is called for each trial, with the id of the process.
    """
    shutil.copy(ROOT / "tests" / "cluster" / "ideas.py", folder)
    args = [scheduler, *(f"{name}={value}" for name, value in options.items())]
    environment = {**os.environ, **_ONE_THREAD, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    began_s = heard_s = time.monotonic()
    client = subprocess.Popen(
        [sys.executable, "-m", "tests.cluster.client", *args],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert client.stdout is not None
    guard = threading.Timer(most_s, client.kill)
    guard.start()
    ended = Ended(None)
    with client.stdout:
        for line in client.stdout:
            now_s = time.monotonic()
            if line == "started\n":
                heard_s = now_s
            ended.silent_s = max(ended.silent_s, now_s - heard_s)
            heard_s = now_s
            ended.lines.append(line.rstrip())
            if line.startswith("done"):
                on_done(client.pid)
                if after_first is not None:
                    after_first()
                    after_first = None
    client.wait()
    ended.code = None if not guard.is_alive() else client.returncode
    guard.cancel()
    ended.seconds = time.monotonic() - began_s
    return ended
