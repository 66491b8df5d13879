"""Runs the cases of real Dask schedulers and workers: `python -m tests.cluster [CASE ...]`.

`--speed`, on an idle machine of two cores: trials a minute of one process and of two workers.

Each case must give the results of one process to the last digit, or end with one sentence and a
non-zero code, and must be silent for at most 30 s. Outside CI, because one case installs another
numpy.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.cluster.cases import CASES
from tests.cluster.processes import Cluster, run_client


def speed() -> int:
    """Compare two workers of one thread with one process; the results must be equal."""
    lessons = {"runs": "24", "teach": "30"}
    with tempfile.TemporaryDirectory() as name, Cluster(Path(name)) as cluster:
        alone = run_client(Path(name), "here", store="alone", **lessons)
        for _ in range(2):
            cluster.add("good")
        both = run_client(Path(name), cluster.address, **lessons)
    print(f"one process {alone.each_minute:.1f} trials a minute, two workers ", end="")
    print(f"{both.each_minute:.1f}: {both.each_minute / alone.each_minute:.2f} times; ", end="")
    print("equal" if both.results == alone.results else "DIFFERENT")
    return 0 if both.results == alone.results else 1


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


sys.exit(speed() if sys.argv[1:] == ["--speed"] else main(sys.argv[1:]))
