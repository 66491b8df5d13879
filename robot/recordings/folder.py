"""The recordings' folder in the data folder."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from robot.recordings.parts import ENDING
from robot.recordings.trash import AGES, TRASH_DAYS
from robot.store.folder import FolderKind, size_of

NAME = "episodes"
_INDEX = ".index.json"
"""Name of the index that version 0.2 wrote. The program no longer uses this index, and removes
it."""


def _debris(folder: Path) -> Iterable[Path]:
    for pattern in ("*.mcap", f"*{ENDING}/*.mcap"):
        yield from (path for path in folder.glob(pattern) if size_of(path) == 0)
    yield from folder.glob(_INDEX)


FOLDER = FolderKind(
    name=NAME,
    about="one MCAP file per run: open with Foxglove, or with the mcap library\n"
    "            NAME.parts has the further files of a long run; keep it next to NAME.mcap\n"
    "            NAME.edits.json next to it lists a person's edits; the recording is not changed\n"
    f"            what is in trash/ is deleted for good after {TRASH_DAYS} days, or at once by\n"
    "            drivelesson episodes empty-trash",
    reads=re.compile(r"[^./][^/]*(\.mcap|\.edits\.json|\.parts/([1-9]\d*\.mcap)?)", re.ASCII),
    files=(AGES,),
    debris=_debris,
)
