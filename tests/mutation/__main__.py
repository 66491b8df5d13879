"""Injects faults into safety-critical modules, and reports those that no test notices.

`make mutate` runs this. Each mutant runs in a forked copy of a process that has imported only
third-party libraries. The output lists each survivor, and each module's score: the share of noticed
mutants.
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
_LOOP = "robot/control/test_loop_requests robot/control/test_loop robot/control/test_loop_stops"
SUBJECTS = {
    "server.clients.lease": "server/clients/test_lease server/test_drive faults/test_faults",
    "server.clients.flow_control": "server/clients/test_flow_control server/clients",
    "server.clients.emergency_stop": "server/test_release",
    "server.clients.rate_limit": "server/clients/test_rate_limit",
    "server.board.stopping": "server/board/test_board",
    "robot.control.gate": f"robot/control/test_gate {_LOOP}",
    "robot.control.link_governor": "robot/control/test_link_governor",
    "robot.control.loop": f"{_LOOP} robot/control/test_guarded_body server/test_drive",
    "robot.control.cycle": f"{_LOOP} robot/control/test_guarded_body robot/bodies/gymnasium "
    "server/test_drive",
    "robot.control.guarded_body": "robot/control/test_guarded_body",
    "robot.control.config": f"robot/control/test_gate {_LOOP} robot/control",
    "robot.control.camera_timing": "robot/control/test_camera_timing",
    "robot.control.online_learning": f"robot/control/test_online_learning {_LOOP} "
    "robot/policy/test_proportional_steering",
    "robot.devkit.host_watchdog": "robot/devkit/test_host_watchdog",
    "robot.policy.history": "robot/policy/test_history",
    "robot.policy.undo": "robot/policy/test_history",
    "robot.policy.changes": "robot/policy/test_history robot/policy/test_alike",
    "robot.policy.action_filter": "robot/policy/test_action_filter robot/policy/test_pilot_pace",
    "robot.policy.example_selection": "robot/policy/test_example_selection",
    "robot.learner.clusters": "robot/learner/test_bsoc",
    "robot.store.disk": "robot/store/test_folder",
}
"""Each module, and the tests that should notice its mutants: files and folders below `tests/`, run
in this order until one fails."""
_LIBRARIES = (
    *("numpy", "hypothesis.strategies", "hypothesis.stateful", "fastapi", "uvicorn", "websockets"),
    *("httpx", "rich.traceback", "cryptography.x509", "anyio.pytest_plugin", "xdist.plugin"),
)
_PATIENCE, _PATIENCE_S = 3, 120
"""Limits at which a mutant counts as hanging, and so as noticed: a multiple of the tests' CPU time
without a fault, and the seconds of one test."""
_UNUSED = 99
"""Exit status of a run in which no test imported the mutant; such a run proves nothing."""


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
        help="inject faults only in these lines",
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
    """Print each surviving mutant of a module as soon as it is known, and the score at the end."""
    path = ROOT / (name.replace(".", "/") + ".py")
    everyone = [mutant for mutant in mutants(path.read_text()) if mutant.line in lines]
    started_s, before = time.monotonic(), os.times()
    if not _survives(name, path, None):
        sys.exit(f"the tests of {name} fail without an injected fault")
    most_cpu_s = 10.0 + _PATIENCE * (sum(os.times()[2:4]) - sum(before[2:4]))
    killed = 0
    with ThreadPoolExecutor(jobs) as pool:
        fates = pool.map(lambda mutant: _survives(name, path, mutant, most_cpu_s), everyone)
        for number, (mutant, survives) in enumerate(zip(everyone, fates, strict=True), 1):
            print(f"{number} of {len(everyone)}", end="\r", file=sys.stderr, flush=True)
            killed += not survives
            if survives:
                print(f"  survives: {name} {mutant}", flush=True)
    share = 100 * killed / max(len(everyone), 1)
    print(f"{name}: {killed} of {len(everyone)} noticed ({share:.0f} %)", end=" ")
    print(f"in {time.monotonic() - started_s:.0f} s", flush=True)


def _survives(name: str, path: Path, mutant: Mutant | None, most_cpu_s: float = 0.0) -> bool:
    """Run the tests on a mutant in a separate process; True if none of them failed. `most_cpu_s` is
    the limit of CPU time, or 0 for no limit."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, 1)
            os.dup2(nowhere, 2)
            signal.setitimer(signal.ITIMER_PROF, most_cpu_s)
            finder = _Finder(name, path, mutant) if mutant is not None else None
            if finder is not None:
                sys.meta_path.insert(0, finder)
            words = ["-q", "-x", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestWarning"]
            # pytest's own finder, which rewrites asserts, comes first and would load the original.
            words += ["--assert=plain", f"--timeout={_PATIENCE_S}"]
            # One file after the other: most mutants are noticed before all files are imported.
            paths = [f"tests/{one}" for one in SUBJECTS[name].split()]
            tests = (path if Path(path).is_dir() else f"{path}.py" for path in paths)
            status = next(filter(None, (int(pytest.main([*words, one])) for one in tests)), 0)
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
