"""Experiments on real Dask schedulers and workers in separate processes, intact and faulty.

Each experiment must give exactly the results of a single process, or end with one sentence.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy
import pytest

from tests.kit.ports import free_port
from tests.kit.sizes import only_full

ROOT = Path(__file__).parents[2]
_SITE = Path(numpy.__file__).parents[1]
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
Kill = Callable[[], None]
"""Kills a process and its child processes."""


class Cluster:
    """A scheduler on a separate port, and the added workers.

    A worker has our code (good), our code with another constant (changed), or no code of ours
    (bare).
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._stack = contextlib.ExitStack()
        shutil.copytree(ROOT / "robot", folder / "changed" / "robot")
        with (folder / "changed/robot/policy/features.py").open("a") as file:
            file.write("\nCHANGED = 1\n")

    def begin(self, kind: str) -> Kill:
        """Start the scheduler, and wait until it listens."""
        words = ["dask_scheduler", "--host", "127.0.0.1", "--port", str(self._port), "--no-show"]
        scheduler = self._start(kind, *words)
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._port)):
                return scheduler
            time.sleep(0.1)

    def add(self, kind: str) -> Kill:
        """Start a worker; one that is called `nanny` is started again when it is lost."""
        more = [] if kind == "nanny" else ["--no-nanny"]
        return self._start(kind, "dask_worker", self.address, "--nthreads", "1", *more)

    def _start(self, kind: str, module: str, *words: str) -> Kill:
        path = {"bare": _SITE, "changed": self._folder / "changed"}.get(kind, ROOT)
        flags = ["-S"] if kind == "bare" else []
        log = self._stack.enter_context((self._folder / f"{module}.log").open("ab"))
        process = subprocess.Popen(
            [sys.executable, *flags, "-m", f"distributed.cli.{module}", *words, "--no-dashboard"],
            cwd=self._folder,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": str(path)},
            stdout=log,
            stderr=log,
            start_new_session=True,
        )

        def kill() -> None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

        self._stack.callback(kill)
        return kill

    def close(self) -> None:
        self._stack.close()


def run_client(folder: Path, *words: str, after_first: Kill = lambda: None) -> list[str]:
    """Run some short lessons in a separate process; return the lines of its output.

    `after_first` is called once, after the first trial.
    """
    client = subprocess.Popen(
        [sys.executable, "-m", "tests.cluster.client", *words],
        cwd=folder,
        env={**os.environ, **_ONE_THREAD, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert client.stdout is not None
    lines: list[str] = []
    with client, client.stdout:
        for line in client.stdout:
            if line.startswith("done") and not any(one.startswith("done") for one in lines):
                after_first()
            lines.append(line.rstrip())
        client.wait()
    return lines


CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "one of two workers is killed": ("equal", {"workers": ("good", "good"), "killed": "worker"}),
    "one worker has other code": ("equal", {"workers": ("changed", "good")}),
    "one and the scheduler are bare": ("equal", {"workers": ("bare", "good"), "scheduler": "bare"}),
    "all workers have other code": ("drivelesson [0-9a-f]+ there, ", {"workers": ["changed"]}),
    "the scheduler is killed": ("the Dask scheduler at .* is lost", {"killed": "scheduler"}),
    "no scheduler": ("no Dask scheduler answers at tcp://127.0.0.1:9", {"at": "tcp://127.0.0.1:9"}),
    "an error cannot be pickled": ("NotPicklableError: odd", {"learner": "ideas.py:Odd"}),
    "an idea ends its worker": (
        "its worker was lost each time", {"learner": "ideas.py:Deadly", "workers": ["nanny"]}
    ),
}  # fmt: skip
"""The expected last line of the client, or `equal` for the results of one process; and options."""


@only_full
@pytest.mark.realtime
@pytest.mark.timeout(1200)
def test_a_real_cluster_gives_the_same_results_or_one_sentence(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra 'dask' is not installed")
    alone = run_client(tmp_path, "here")[-1]
    assert alone.startswith("results ")
    for name, (expected, case) in CASES.items():
        folder = tmp_path / name
        folder.mkdir()
        shutil.copy(Path(__file__).with_name("ideas.py"), folder)
        with contextlib.closing(Cluster(folder)) as cluster:
            scheduler = cluster.begin(case.get("scheduler", "good"))
            workers = [cluster.add(kind) for kind in case.get("workers", ["good"])]
            kills = {"worker": workers[0], "scheduler": scheduler}
            kill = kills.get(case.get("killed", ""), lambda: None)
            words = (case.get("at", cluster.address), case.get("learner", "default-8"))
            said = run_client(folder, *words, after_first=kill)
        if expected == "equal":
            assert said[-1] == alone, (name, said[-3:])
        else:
            assert re.search(expected, said[-1]), (name, said[-3:])
