"""Puts faults into the safety-critical modules, and reports whether tests notice: `make mutate`.

Each mutant runs in a forked copy of a process that has imported the libraries but nothing of this
project. Prints each survivor, and the score of each module: the share of noticed mutants.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import importlib.abc
import importlib.machinery
import os
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import pytest

from .mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[2]
SUBJECTS: dict[str, tuple[str, ...]] = {
    "server.clients.lease": (
        "tests/server/clients/test_lease.py",
        "tests/server/test_drive.py",
        "tests/faults/test_faults.py",
    ),
    "server.clients.flow_control": (
        "tests/server/clients/test_flow_control.py",
        "tests/server/clients",
    ),
    "robot.control.link_governor": ("tests/robot/control/test_link_governor.py",),
    "robot.policy.history": ("tests/robot/policy/test_history.py",),
    "robot.policy.undo": ("tests/robot/policy/test_history.py",),
    "robot.policy.changes": (
        "tests/robot/policy/test_history.py",
        "tests/robot/policy/test_alike.py",
        "tests/robot/policy/test_policy.py",
    ),
    "robot.control.config": ("tests/robot/control",),
    "robot.control.gate": (
        "tests/robot/control/test_gate.py",
        "tests/robot/control/test_loop.py",
        "tests/robot/control/test_loop_stops.py",
    ),
    "robot.control.loop": ("tests/robot/control/test_loop_requests.py", "tests/robot/control"),
    "robot.control.cycle": (
        "tests/robot/control/test_loop.py",
        "tests/robot/control/test_loop_requests.py",
        "tests/robot/control/test_loop_stops.py",
        "tests/robot/control",
    ),
}
"""Each module, and the tests that should notice its mutants. They run in this order until one
fails."""
_LIBRARIES = ("numpy", "hypothesis", "hypothesis.strategies", "fastapi", "uvicorn", "websockets")
_PATIENCE_CPU_S = 120
_PATIENCE_S = 1200
"""Time limits of a mutant that hangs, which counts as noticed: of CPU time, or of the clock if it
only waits."""
_UNUSED = 99
"""Exit status of a run in which no test imported the mutant, so that the run says nothing about the
tests."""


def main() -> int:
    """Run all mutants; the result is a report, never a failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("modules", nargs="*", default=list(SUBJECTS))
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument(
        "--lines",
        type=_lines,
        default=range(1, sys.maxsize),
        metavar="FIRST-LAST",
        help="only faults in these lines: a run in parts, or once more where one survived",
    )
    args = parser.parse_args()
    os.chdir(ROOT)
    for name in _LIBRARIES:
        importlib.import_module(name)
    for name in args.modules:
        report(name, args.jobs, args.lines)
    return 0


def _lines(text: str) -> range:
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def report(name: str, jobs: int, lines: range) -> None:
    """Print the surviving mutants of one module, each at once, and the score at the end."""
    path = ROOT / (name.replace(".", "/") + ".py")
    everyone = [mutant for mutant in mutants(path.read_text()) if mutant.line in lines]
    started_s = time.monotonic()
    if not _survives(name, path, None):
        sys.exit(f"the tests of {name} fail without any fault put in")
    killed = 0
    with ThreadPoolExecutor(jobs) as pool:
        fates = pool.map(lambda mutant: _survives(name, path, mutant), everyone)
        for mutant, survives in zip(everyone, fates, strict=True):
            killed += not survives
            if survives:
                print(f"  survives: {name} {mutant}", flush=True)
    share = 100 * killed / max(len(everyone), 1)
    print(f"{name}: {killed} of {len(everyone)} noticed ({share:.0f} %)", end=" ")
    print(f"in {time.monotonic() - started_s:.0f} s", flush=True)


def _survives(name: str, path: Path, mutant: Mutant | None) -> bool:
    """Run the tests on a mutant in a separate process; True if none of them failed."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            signal.setitimer(signal.ITIMER_PROF, _PATIENCE_CPU_S)
            signal.alarm(_PATIENCE_S)
            finder = _Finder(name, path, mutant) if mutant is not None else None
            if finder is not None:
                sys.meta_path.insert(0, finder)
            words = ["-q", "-x", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestWarning"]
            # pytest's own finder, which rewrites asserts, comes first and would load the original.
            status = int(pytest.main(["--assert=plain", *words, *SUBJECTS[name]]))
            if finder is not None and not finder.is_used:
                status = _UNUSED
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == _UNUSED:
        raise RuntimeError(f"the tests of {name} did not load the mutant")
    return status == 0


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Returns a mutant when the module of its name is imported."""

    def __init__(self, name: str, path: Path, mutant: Mutant) -> None:
        self._name, self._path, self._mutant = name, path, mutant
        self.is_used = False

    def find_spec(
        self, fullname: str, path: object = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._name:
            return None
        spec = importlib.machinery.ModuleSpec(fullname, self, origin=str(self._path))
        spec.has_location = True
        return spec

    def exec_module(self, module: ModuleType) -> None:
        self.is_used = True
        tree = ast.fix_missing_locations(self._mutant.tree)
        exec(compile(tree, str(self._path), "exec"), module.__dict__)


if __name__ == "__main__":
    sys.exit(main())
