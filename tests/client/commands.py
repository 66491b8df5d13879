"""A command line beside the running server."""

from __future__ import annotations

import contextlib
import io
import random
from pathlib import Path
from typing import Any

from server.cli.main import main
from tests.client.bodies import Pool


class Command:
    """One call of the command line beside the running server.

    Attributes:
        words: The words after `drivelesson`.
        changes: True if it changes episodes.
    """

    def __init__(self, dice: random.Random, pool: Pool, root: Path, kind: str = "") -> None:
        episode = dice.choice([*pool.episodes, "last", "nothing"])
        self._episode = episode
        kind = kind or dice.choice(
            [
                *("list", "show", "export", "budget"),
                *("title", "protect", "unprotect", "relabel", "trim", "undo", "compact"),
                *("delete", "delete", "restore", "zip"),
            ]
        )
        self.kind, self._title = kind, dice.choice(["a title", "another", "Ä"])
        self.changes = kind not in ("list", "show", "export", "budget")
        a_range = ["--from", str(dice.randrange(3)), "--to", str(3 + dice.randrange(3))]
        more = {
            "list": [],
            "budget": ["--gigabytes", "1"],
            "title": [episode, self._title],
            "relabel": [episode, *a_range, "--label", dice.choice(["left", "right"])],
            "trim": [episode, *a_range],
            "delete": [episode, *dice.choice([a_range, []])],
            "restore": [dice.choice([*pool.keys, "nothing"])],
            "zip": [episode, *dice.choice([["--delete"], []])],
            "export": [episode, "--as", dice.choice(["npz", "folder", "tub"])],
        }.get(kind, [episode])
        self.words = ["episodes", kind, *more, "--data", str(root)]
        self.is_whole = kind == "delete" and "--from" not in more

    def run(self) -> tuple[int, str]:
        """Return its exit status and its last words."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = main(self.words)
            except SystemExit as ended:
                status = int(ended.code or 0)
        return status, (err.getvalue() or out.getvalue())[-500:]

    def untrue(self, episodes: dict[str, Any]) -> str | None:
        """Return what is not as the command said; `episodes` are facts after its success."""
        found = episodes.get(self._episode)
        if self._episode in ("last", "nothing"):
            return None
        if self.is_whole and found is not None:
            return "deleted, and still there"
        if found is None:  # the recording that is being written is not among the facts
            return None
        title, is_protected = found[:2]
        if self.kind == "title" and title != self._title:
            return f"the title is {title!r}"
        if self.kind in ("protect", "unprotect") and is_protected is not (self.kind == "protect"):
            return f"protected is {is_protected}"
        return None
