"""Runs a task, and returns an outcome that can be pickled for another process."""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from robot.errors import RobotError
from robot.lab.task import Params, Result, Task


class TrialError(RobotError):
    """A run raised an error. The message contains the task, and the traceback if the error was
    unexpected."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a run, or its error as text, because a plugin's error may not be picklable."""

    result: Result | None = None
    error: str = ""
    traceback: str = ""

    def value(self, task: Task, where: str = "") -> Result:
        """Return the result. Raises TrialError, with the run's traceback, if there is no result."""
        if self.result is None:
            raise TrialError(f"{self.traceback}the run {task} failed{where}: {self.error}")
        return self.result


Contents = Mapping[str, tuple[str, bytes]]
"""The files to which a task's parameters refer: maps a parameter's value to the path and content of
its file."""


def contents_of(task: Task) -> Contents:
    return {value: (file, Path(file).read_bytes()) for value, file in task.files.items()}


def run_task(task: Task, contents: Contents | None = None) -> Outcome:
    """Run a task; never raises an Exception.

    `contents` contains the task's input files, for a machine that does not have these files.
    """
    try:
        return Outcome(result=task.run(_placed(task.params, contents or {})))
    except RobotError as error:
        cause = error.__cause__
        is_ours = cause is None or isinstance(cause, RobotError | OSError)
        return Outcome(error=str(error), traceback="" if is_ours else _in_words(cause))
    except Exception as error:  # a plugin may raise anything
        return Outcome(error=f"{type(error).__name__}: {error}", traceback=_in_words(error))


def _in_words(error: BaseException | None) -> str:
    return "".join(traceback.format_exception(error)) if error is not None else ""


def _placed(params: Params, contents: Contents) -> Params:
    """Write each file in `contents` to a temporary folder of this process. Return the parameters
    with the new paths."""
    placed = dict(params)
    for name, value in params.items():
        if isinstance(value, str) and value in contents:
            file, data = contents[value]
            path = Path(_folder().name, sha256(data).hexdigest()[:16], Path(file).name)
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(data)
            placed[name] = f"{path}{value[len(file) :]}"
    return placed


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="drivelesson-")
