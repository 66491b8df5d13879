"""One independent run as data: what is run, with which seed. Equal tasks give equal numbers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

Params = Mapping[str, Any]
"""Plain values."""
Result = dict[str, Any]
"""Plain figures, ready for JSON. What depends on the machine's speed stands under `timing`."""


@dataclass(frozen=True, slots=True)
class Task:
    """A run with its parameters. `run` is a function of a module, so that processes can share it.

    The same task gives the same figures on every machine.
    """

    run: Callable[[Params], Result]
    params: Params

    @property
    def kind(self) -> str:
        """What is run, by name."""
        return self.run.__name__.removeprefix("run_")

    def key(self) -> str:
        """Return the name under which its result is saved: a fingerprint of task and program.

        A changed program, idea file or recording gives another key: old results are not reused.
        """
        text = json.dumps([self.kind, dict(self.params), program_fingerprint()], sort_keys=True)
        digest = hashlib.sha256(text.encode())
        for value in self.params.values():
            if isinstance(value, str):
                digest.update(b"\n" + _content(value))
        return digest.hexdigest()[:20]


@cache
def program_fingerprint() -> str:
    """Return a fingerprint of everything in `robot/`."""
    folder = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
        digest.update(str(path.relative_to(folder)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _content(text: str) -> bytes:
    """Return the content of a file that a parameter such as `path.py:Name` names, if there is."""
    for path in (Path(text), Path(text.rpartition(":")[0])):
        if path.suffix in (".py", ".toml", ".npz") and path.is_file():
            return path.read_bytes()
    return b""
