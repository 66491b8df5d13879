"""Many independent tasks: side by side through joblib, here or on a Dask cluster.

Each result is on the disk as soon as its run is finished: a crash or Ctrl-C loses none of them.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError, need, told_as
from robot.lab.task import Result, Task
from robot.store.folder import write_whole


class Store:
    """A folder of results, one small file each, by the keys of their tasks."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with told_as(ConfigurationError, f"cannot save results in {folder}"):
            folder.mkdir(parents=True, exist_ok=True)

    def get(self, task: Task, key: str = "") -> Result | None:
        """Return the result of a task that is done; None if it is not, or its file is broken."""
        try:
            kept = json.loads(self._path(task, key).read_text("utf-8"))
            return dict(kept["result"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def put(self, task: Task, result: Result, key: str = "") -> None:
        """Save a result atomically: the whole file or nothing."""
        path = self._path(task, key)
        text = json.dumps({"kind": task.kind, "params": dict(task.params), "result": result})
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
) -> list[Result]:
    """Return the results of all tasks, in their order; tasks with a stored result are not run.

    Args:
        jobs: How many at a time on this machine; 1 runs them here, without other processes.
        backend: `processes`, or `dask` for the cluster whose `scheduler` is named.
        on_done: Called with each task when it is done.

    Raises:
        MissingExtraError: If joblib or dask is not installed.
        ConfigurationError: If the cluster cannot be reached, or a file that a task names is changed
            meanwhile: nobody knows what was run then.
    """
    keys = [task.key() for task in tasks]  # once: each reads the files that its task names
    done: dict[str, Result] = {}
    waiting: dict[str, Task] = {}
    for key, task in zip(keys, tasks, strict=True):
        if (result := store.get(task, key)) is None:
            waiting.setdefault(key, task)
        else:
            done[key] = result
            on_done(task)
    joblib = need("joblib", "running experiments side by side", "experiments")
    with contextlib.ExitStack() as stack:
        if backend == "dask":
            stack.enter_context(_connected(scheduler))
            stack.enter_context(joblib.parallel_config(backend="dask"))
        parallel = joblib.Parallel(
            n_jobs=-1 if backend == "dask" else jobs, return_as="generator_unordered", batch_size=1
        )
        runs = (joblib.delayed(_run)(key, task) for key, task in waiting.items())
        for key, result in parallel(runs):
            task = waiting[key]
            if task.key() != key:
                raise ConfigurationError(
                    f"a file of the task {task.kind} was changed while it ran; start it again: "
                    "what was finished before is kept"
                )
            store.put(task, result, key)
            done[key] = result
            on_done(task)
    return [done[key] for key in keys]


def _run(key: str, task: Task) -> tuple[str, Result]:
    return key, task.run(task.params)


def _connected(scheduler: str | None) -> Any:
    """Return a client of an existing cluster, to be used as a context manager."""
    distributed = need("distributed", "the backend dask", "dask")
    if scheduler is None:
        raise ConfigurationError("--backend dask needs --scheduler ADDRESS")
    why = f"no Dask scheduler answers at {scheduler}"
    with told_as(ConfigurationError, why, OSError, ValueError):
        return distributed.Client(scheduler, timeout=10)
