"""Runs some short lessons, on this machine or on a cluster, as a person would start them."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from robot.errors import RobotError
from robot.lab.lessons import run_lesson
from robot.lab.runner import Store, run_all
from robot.lab.task import Task

LESSON = {
    "world": "box",
    "moves": ("forward", "left"),
    "teacher": "usual",
    "teach_s": 1.5,
    "correct_s": 0.5,
    "alone_s": 0.5,
    "reference_s": 0.5,
}


def main(scheduler: str, learner: str = "default-8") -> int:
    tasks = [Task(run_lesson, {**LESSON, "learner": learner, "seed": n}) for n in range(4)]
    is_here = scheduler == "here"
    try:
        results = run_all(
            tasks,
            Store(Path("kept" if not is_here else "here")),
            jobs=1,
            backend="processes" if is_here else "dask",
            scheduler=None if is_here else scheduler,
            on_done=lambda task: print(f"done {task}", flush=True),
            on_workers=lambda count, change: print(f"{count} workers: {change}", flush=True),
        )
    except RobotError as error:
        print(error)
        return 1
    for result in results:
        result.pop("timing")
    print("results", hashlib.sha256(json.dumps(results).encode()).hexdigest()[:16])
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
