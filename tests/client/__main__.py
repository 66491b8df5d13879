"""A random client of every route, message and fault, and a model of the answers.

`python -m tests.client --steps 200000 --kills 500 --seed 1`: each life of the server is a separate
process in virtual time. It is killed (SIGKILL) at any instruction, at a call of the disk, or
between two steps. The next life starts on its folder, which must contain everything that was
answered.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.client.run import Outcome, run

_SPAWN = multiprocessing.get_context("spawn")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=0, help="0: one in 400 steps")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="robots at a time, a folder for each")
    parser.add_argument("--first", action="store_true", help="end at the first violation")
    args = parser.parse_args()
    began_s = time.monotonic()
    jobs = max(1, args.jobs)
    kills = args.kills or max(1, args.steps // 400)
    with tempfile.TemporaryDirectory() as name, ProcessPoolExecutor(jobs, _SPAWN) as pool:
        outcomes = pool.map(
            run,
            [Path(name) / str(job) for job in range(jobs)],
            [-(-args.steps // jobs)] * jobs,
            [-(-kills // jobs)] * jobs,
            [1000 * args.seed + job for job in range(jobs)],
            [args.first] * jobs,
        )
        outcome = sum(outcomes, Outcome())
    print(f"{outcome}; {time.monotonic() - began_s:.0f} s, seed {args.seed}")
    return 1 if outcome.violations else 0


if __name__ == "__main__":
    sys.exit(main())
