"""One independent run as data: what is run, with which seed. Equal tasks give equal numbers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

Result = dict[str, Any]
"""Plain figures, ready for JSON. What depends on the machine's speed stands under `timing`."""


@dataclass(frozen=True, slots=True)
class Task:
    """A run of one `kind` (a key of `kinds.RUNNERS`) with its parameters, all plain values."""

    kind: str
    params: Mapping[str, Any] = field(default_factory=dict)

    def key(self) -> str:
        """Return the name under which its result is saved: a fingerprint of task and program.

        A changed program or idea file gives another key, so old results are not reused.
        """
        text = json.dumps([self.kind, dict(self.params), program_fingerprint()], sort_keys=True)
        files = [_content(value) for value in self.params.values() if isinstance(value, str)]
        return hashlib.sha256("\n".join([text, *files]).encode()).hexdigest()[:20]


@cache
def program_fingerprint() -> str:
    """Return a fingerprint of everything in `robot/` that a run's numbers depend on."""
    folder = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
        relative = path.relative_to(folder)
        if not any(relative.is_relative_to(part) for part in _PARTS_THAT_COUNT):
            continue
        digest.update(str(relative).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


_PARTS_THAT_COUNT = (
    *("learner", "policy", "devices/simulation", "control", "exchange/npz.py"),
    *("bodies/ev3/integer_policy.py", "bodies/ev3/integer_ridge.py"),
    *("bodies/ev3/integer_features.py", "lab/variants.py", "lab/baselines", "lab/eyes"),
    *("lab/metrics", "lab/evaluation.py", "lab/trial.py", "lab/kinds.py", "lab/footage.py"),
    *("lab/pilots.py", "lab/simulated_pilots", "lab/cycles.py", "lab/episodes.py"),
    *("lab/habit_run.py", "lab/ready_run.py", "lab/mind_run.py", "lab/ground"),
    *("lab/streams.py", "lab/adapters"),
    *("clock.py", "driver.py", "types.py"),
)


def _content(text: str) -> str:
    """Return the content of a file that a parameter such as `path.py:Name` names, if there is."""
    path = Path(text.rpartition(":")[0] or text)
    if path.suffix in (".py", ".toml") and path.is_file():
        return path.read_text("utf-8", errors="replace")
    return ""
