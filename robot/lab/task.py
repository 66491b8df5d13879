"""Describes one independent run by its function, parameters and seed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from robot.lab.identity import identify

Params = Mapping[str, Any]
"""Parameters as plain values."""
Result = dict[str, Any]
"""Results as plain values for JSON.

Measures that depend on the machine's speed are under `timing`.
"""
_FILES = (".py", ".toml", ".npz")
"""Suffixes of the files that a task may need: Python files, worlds and recordings."""


@dataclass(frozen=True, slots=True)
class Task:
    """One run of an experiment: a function and its parameters. `run` is defined at the top of a
    module, so that other processes find it.

    Equal tasks yield equal results, on every machine.
    """

    run: Callable[[Params], Result]
    params: Params

    @property
    def kind(self) -> str:
        """The name of the function, without `run_`."""
        return self.run.__name__.removeprefix("run_")

    def __str__(self) -> str:
        """Return the run in words: its kind and its parameters."""
        said = [f"{name} {self.params[name]}" for name in _TOLD if name in self.params]
        return ", ".join([self.kind, *said])

    @property
    def files(self) -> dict[str, str]:
        """Maps each parameter that refers to a file, such as `idea.py:Name`, to the file's path."""
        found = {}
        for value in self.params.values():
            for file in (value, value.rpartition(":")[0]) if isinstance(value, str) else ():
                if Path(file).suffix in _FILES and Path(file).is_file():
                    found[value] = file
        return found

    def key(self) -> str:
        """Return the key under which the result is saved: a fingerprint of task and program.

        The key also depends on the libraries, and on the contents of the task's files, so that a
        result of an older version is not reused.
        """
        text = json.dumps([self.kind, dict(self.params), identity()], sort_keys=True)
        digest = hashlib.sha256(text.encode())
        for file in self.files.values():
            digest.update(b"\n" + Path(file).read_bytes())
        return digest.hexdigest()[:20]


_TOLD = ("trial", "world", "learner", "teacher", "place", "teach_s", "seed")


@cache
def identity() -> dict[str, str]:
    """Return the versions of all code that affects this process's results; see `identify`."""
    return identify()
