"""The program that a person would start: some short lessons, here or on a cluster; for
`tests.cluster`."""

from __future__ import annotations

import hashlib
import json
import sys
import time
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


def main(scheduler: str, *options: str) -> int:
    print("started")  # silence counts from here: a busy machine imports for half a minute
    chosen = dict(option.split("=", 1) for option in options)
    learner, runs = chosen.get("learner", "default-8"), int(chosen.get("runs", "4"))
    lesson = {**LESSON, "learner": learner, "teach_s": float(chosen.get("teach", "1.5"))}
    tasks = [Task(run_lesson, {**lesson, "seed": n}) for n in range(runs)]
    is_here = scheduler == "here"
    hold_s = float(chosen.get("hold", "0"))

    def tell(task: Task) -> None:
        nonlocal hold_s
        print(f"done {task}")
        time.sleep(hold_s)
        hold_s = 0.0

    try:
        results = run_all(
            tasks,
            Store(Path(chosen.get("store", "kept"))),
            jobs=int(chosen.get("jobs", "1")),
            backend="processes" if is_here else "dask",
            scheduler=None if is_here else scheduler,
            on_done=tell,
            on_workers=lambda count, change: print(f"{count} workers: {change}"),
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
