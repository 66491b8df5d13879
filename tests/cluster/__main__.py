"""Runs the cases of real Dask schedulers and workers: `python -m tests.cluster [CASE ...]`.

Each case must give the results of one process to the last digit, or end with one sentence and a
non-zero code, and must be silent for at most 30 s. Outside CI, because one case installs another
numpy.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.cluster.cases import CASES
from tests.cluster.processes import run_client


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


sys.exit(main(sys.argv[1:]))
