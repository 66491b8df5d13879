"""Prints a digest of all that is read of recordings: the same on every system, or one is wrong.

python -m tests.windows.readings RECORDING ...
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from robot.store.episodes.edits import read_notes
from robot.store.episodes.episode import open_episode
from robot.store.episodes.teaching import plan


def digest(path: Path) -> str:
    """Return a line on a recording: its name, its examples, and what stands in them."""
    episode, found = open_episode(path), hashlib.sha256(path.read_bytes())
    steps = plan([(episode, read_notes(path))])
    for step in steps:
        picture = episode.frame(step.frame_id) if step.edit is None else None
        found.update(repr((step.frame_id, step.label, step.at_s, step.is_correction)).encode())
        found.update(b"" if picture is None else bytes(picture.data))
        found.update(b"" if step.x is None else step.x.tobytes())
    return f"{path.name}: {len(steps)} examples, {found.hexdigest()[:32]}"


if __name__ == "__main__":
    for word in sys.argv[1:]:
        print(digest(Path(word)))
