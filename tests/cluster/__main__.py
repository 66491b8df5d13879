"""Runs the cases of real Dask schedulers and workers: `python -m tests.cluster [CASE ...]`.

Each case must give the results of one process to the last digit, or end with one sentence and a
non-zero code, and must be silent for at most 30 s. Outside CI, because one case installs another
numpy.

`--speed`, on an idle machine of two cores: trials a minute of one process, of two workers, and of
two processes that know nothing of each other, which is the most that the machine can do. The CPU
time of a trial is measured, too; it depends less on other load.
`--memory TRIALS`: memory of one process and of a worker, after 20 trials and at the end.
"""

from __future__ import annotations

import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from tests.cluster.cases import CASES
from tests.cluster.processes import Cluster, Ended, run_client
from tests.soak.measured import measure_process

_TRIALS, _WARM, _TEACH_S = 20, 4, 240
"""Number of trials of `--speed`, how many of them only warm up, and the length of the teaching, as
in the experiments. The first trial of a process costs more, because it imports the simulator; and a
worker cleans its memory after each trial, which takes a seventh of a trial of half a second."""
_EARLY, _MOST_GROWTH = 20, 1.1


class Watch:
    """The time, and the measures of client, scheduler and workers, after each trial."""

    def __init__(self, cluster: Cluster) -> None:
        self._cluster = cluster
        self.rows: list[tuple[float, list[dict[str, float]]]] = []

    def __call__(self, pid: int) -> None:
        measured = [measure_process(one) for one in (pid, *self._cluster.pids)]
        self.rows.append((time.monotonic(), measured))

    def pace(self) -> tuple[float, float]:
        """Return trials a minute, and the CPU seconds of a trial, without those that warm up."""
        (first_s, first), (last_s, last) = self.rows[_WARM], self.rows[-1]
        trials = len(self.rows) - 1 - _WARM
        cpu_s = sum(b["CPU s"] - a["CPU s"] for a, b in zip(first, last, strict=True))
        return 60 * trials / (last_s - first_s), cpu_s / trials

    def memory_mb(self, process: int) -> tuple[float, float]:
        """Return the memory of a process after some trials, and at the end."""
        early, late = self.rows[_EARLY - 1][1][process], self.rows[-1][1][process]
        return early["memory MB"], late["memory MB"]


def speed() -> int:
    """Compare two workers of one thread with one process; the results must be equal."""
    run = partial(run_client, runs=str(_TRIALS), teach=str(_TEACH_S), most_s=1800.0)
    with tempfile.TemporaryDirectory() as name, Cluster(Path(name)) as cluster:
        folder = Path(name)
        alone, left, right, workers = (Watch(cluster) for _ in range(4))
        expected = run(folder, "here", store="alone", on_done=alone)
        with ThreadPoolExecutor(2) as two:
            for store, watch in (("left", left), ("right", right)):
                two.submit(run, folder, "here", store=store, on_done=watch)
        for _ in range(2):
            cluster.add("good")
        both = run(folder, cluster.address, on_done=workers)
    (each_minute, cpu_s), (shared, shared_s) = alone.pace(), workers.pace()
    at_once = left.pace()[0] + right.pace()[0]
    print(f"one process            {each_minute:6.1f} trials a minute, {cpu_s:.3f} s of CPU each")
    print(f"two separate processes {at_once:6.1f}: {at_once / each_minute:.2f} times")
    print(f"two workers            {shared:6.1f}: {shared / each_minute:.2f} times, ", end="")
    print(f"{shared_s:.3f} s of CPU each, scheduler and client included")
    return _say_equal(expected, both)


def memory(trials: int) -> int:
    """Compare the memory of one process, and of a worker, after 20 trials and after all."""
    run = partial(run_client, runs=str(trials), most_s=60.0 * trials)
    with tempfile.TemporaryDirectory() as name, Cluster(Path(name)) as cluster:
        here, there = Watch(cluster), Watch(cluster)
        expected = run(Path(name), "here", store="here", on_done=here)
        cluster.add("good")
        ended = run(Path(name), cluster.address, on_done=there)
    rows = {"one process": here.memory_mb(0)}
    rows |= {of: there.memory_mb(n) for n, of in enumerate(("client", "scheduler", "worker"))}
    for of, (early_mb, late_mb) in rows.items():
        print(f"{of:12} {early_mb:6.1f} MB after {_EARLY} trials, ", end="")
        print(f"{late_mb:6.1f} after {trials}: {late_mb / early_mb:.3f} times")
    is_bounded = all(late_mb <= _MOST_GROWTH * early_mb for early_mb, late_mb in rows.values())
    return _say_equal(expected, ended) or (0 if is_bounded else 1)


def _say_equal(expected: Ended, ended: Ended) -> int:
    is_equal = ended.results == expected.results != ""
    print("equal results" if is_equal else f"DIFFERENT results: {ended.lines[-3:]}")
    return 0 if is_equal else 1


def main(names: list[str]) -> int:
    with tempfile.TemporaryDirectory() as folder:
        alone = run_client(Path(folder), "here", store="alone")
        alone8 = run_client(Path(folder), "here", store="alone8", runs="8")
        print(f"one process: {alone.results}", flush=True)
        failed = []
        for name in names or CASES:
            place = Path(tempfile.mkdtemp(dir=folder))
            ended, expected = CASES[name](place)
            wanted = alone8.results if name == "late_stranger" else alone.results
            verdict = ended.verdict(expected, wanted)
            failed += [name] if verdict.startswith("WRONG") else []
            print(f"{name:32} {ended.seconds:5.1f} s  silent {ended.silent_s:4.1f} s  {verdict}")
            sys.stdout.flush()
    print(f"{len(failed)} of {len(names or CASES)} wrong {' '.join(failed)}".rstrip())
    return 1 if failed else 0


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--speed"]:
            sys.exit(speed())
        case ["--memory", trials]:
            sys.exit(memory(int(trials)))
        case names:
            sys.exit(main(names))
