"""Runs independent tasks in parallel processes on this machine, or on a Dask cluster.

Each result is saved as soon as its run is finished, so that a crash or Ctrl-C does not lose it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from robot.errors import ConfigurationError, need, told_as
from robot.lab.cluster import run_on_cluster
from robot.lab.outcome import Outcome, run_task
from robot.lab.task import Result, Task, identity
from robot.store.folder import write_whole


class Store:
    """A folder with the results of tasks. Each result is a small file, and its name is the key of
    its task."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with told_as(ConfigurationError, f"cannot save results in {folder}"):
            folder.mkdir(parents=True, exist_ok=True)

    def get(self, task: Task, key: str = "") -> Result | None:
        """Return the saved result of a task; None if there is none, or its file is damaged."""
        try:
            kept = json.loads(self._path(task, key).read_text("utf-8"))
            return dict(kept["result"]) if kept["made_by"] == identity() else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def put(self, task: Task, result: Result, key: str = "") -> None:
        """Save a result atomically."""
        path = self._path(task, key)
        made = {"kind": task.kind, "params": dict(task.params), "made_by": identity()}
        text = json.dumps({**made, "result": result})
        with told_as(ConfigurationError, f"cannot save results in {self.folder}"):
            write_whole(path, text.encode())

    def _path(self, task: Task, key: str) -> Path:
        return self.folder / f"{task.kind}-{key or task.key()}.json"


def run_all(
    tasks: Sequence[Task],
    store: Store,
    *,
    jobs: int = 2,
    backend: str = "processes",
    scheduler: str | None = None,
    on_done: Callable[[Task], object] = lambda task: None,
    on_workers: Callable[[int, str], object] = lambda count, change: None,
) -> list[Result]:
    """Return the results of all tasks, in their order. A task with a stored result is not run.

    Args:
        jobs: Number of parallel processes on this machine; if 1, tasks run in this process.
        backend: `processes`, or `dask` for the cluster whose `scheduler` is named.
        on_done: Called with each task when it is done.
        on_workers: Called with the number of workers, and a sentence about what has changed.

    Raises:
        MissingExtraError: If joblib or dask is not installed.
        TrialError: If a run raised an error; the message has its traceback.
        ConfigurationError: If the cluster cannot be used, or if a file of a task is changed during
            the run, because either version of the file may have been used.
    """
    # Compute each key only once, because each computation reads all files of the task.
    keys = [task.key() for task in tasks]
    done: dict[str, Result] = {}
    waiting: dict[str, Task] = {}
    for key, task in zip(keys, tasks, strict=True):
        if (result := store.get(task, key)) is None:
            waiting.setdefault(key, task)
        else:
            done[key] = result
            on_done(task)
    if backend == "dask":
        outcomes = run_on_cluster(scheduler, waiting, on_workers)
    else:
        outcomes = _run_here(waiting, jobs)
        on_workers(jobs, "")
    for key, outcome, where in outcomes:
        task = waiting[key]
        result = outcome.value(task, where)
        if task.key() != key:
            raise ConfigurationError(
                f"a file of the task {task.kind} was changed while the task ran; finished "
                "results are kept. Run the same command again"
            )
        store.put(task, result, key)
        done[key] = result
        on_done(task)
    return [done[key] for key in keys]


def _run_here(waiting: Mapping[str, Task], jobs: int) -> Iterator[tuple[str, Outcome, str]]:
    joblib = need("joblib", "running experiments side by side", "experiments")
    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
    try:
        yield from parallel(joblib.delayed(_run)(key, task) for key, task in waiting.items())
    except BrokenProcessPool as error:
        raise ConfigurationError(
            "a process that ran trials was killed, perhaps because the memory was full; "
            "finished results are kept. Run the same command again with a smaller --jobs"
        ) from error


def _run(key: str, task: Task) -> tuple[str, Outcome, str]:
    return key, run_task(task), ""
