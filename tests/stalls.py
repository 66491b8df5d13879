"""`make test-stalls`: runs the real-time tests while the machine is paused at random.

Pauses occur on a laptop that wakes up, and on a shared machine. All processes of the run are paused
for some seconds and then continue. A test may take longer because of a pause, but must not fail.
"""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

RUNS_S, STANDS_S = (0.5, 10.0), (2.0, 3.5)
"""Pauses are shorter than 4 s, the timeout of robots in the page's tests (tests/e2e/world.py)."""


def find_running(root: int) -> list[int]:
    """Return a process and its descendants, except stopped ones."""
    children: dict[int, list[int]] = {}
    stopped = set()
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            process = int(entry.name)
            state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
            children.setdefault(int(parent), []).append(process)
            if state in "TtZ":
                stopped.add(process)
    found = [root]
    for process in found:  # the list may grow meanwhile
        found += children.get(process, [])
    return [process for process in found if process not in stopped]


def hold(root: int, seconds: float) -> None:
    """Pause all processes, and continue them."""
    held: list[int] = []
    while new := set(find_running(root)) - set(held):  # a process may start another one meanwhile
        for process in new:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGSTOP)
            held.append(process)
    time.sleep(seconds)
    for process in reversed(held):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGCONT)


def main(arguments: list[str]) -> int:
    chance, stalls = random.Random(0), 0
    with subprocess.Popen([sys.executable, "-m", "pytest", *arguments]) as tests:
        while True:
            try:
                code = tests.wait(chance.uniform(*RUNS_S))
            except subprocess.TimeoutExpired:
                hold(tests.pid, chance.uniform(*STANDS_S))
                stalls += 1
            else:
                print(f"all processes were paused {stalls} times")
                return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
