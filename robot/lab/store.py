"""Finished runs on disk, one small file each: a crash or Ctrl-C loses none of them."""

from __future__ import annotations

import json
from pathlib import Path

from robot.errors import ConfigurationError
from robot.lab.task import Result, Task
from robot.store.folder import write_whole


class Store:
    """A folder of results, by the keys of their tasks."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigurationError(f"cannot save results in {folder}: {error}") from error

    def get(self, task: Task) -> Result | None:
        """Return the result of a task that is done; None if it is not, or its file is broken."""
        try:
            kept = json.loads(self._path(task).read_text("utf-8"))
            return dict(kept["result"])
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def put(self, task: Task, result: Result) -> None:
        """Save a result atomically: the whole file or nothing."""
        path = self._path(task)
        text = json.dumps({"kind": task.kind, "params": dict(task.params), "result": result})
        try:
            write_whole(path, text.encode())
        except OSError as error:
            raise ConfigurationError(f"cannot save results in {self.folder}: {error}") from error

    def _path(self, task: Task) -> Path:
        return self.folder / f"{task.kind}-{task.key()}.json"
