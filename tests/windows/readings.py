"""Prints a digest of the data in recordings, which must be the same on every system.

python -m tests.windows.readings RECORDING ...
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from robot.policy.events import Taught
from robot.recordings.episode import open_episode


def digest(path: Path) -> str:
    """Return a line about a recording: its name, its numbers of pictures and examples, and a digest
    of its content."""
    episode, found = open_episode(path), hashlib.sha256(path.read_bytes())
    for frame_id in episode.frames:
        picture = episode.frame(frame_id)
        found.update(repr((frame_id, picture.width, picture.height, picture.captured_s)).encode())
        found.update(picture.data)
    taught = [(at, event) for at, event in episode.events if isinstance(event, Taught)]
    for at, event in taught:
        found.update(repr((at, event.example, event.at_s)).encode() + event.x.tobytes())
    frames = len(list(episode.frames))
    return f"{path.name}: {frames} pictures, {len(taught)} examples, {found.hexdigest()[:32]}"


if __name__ == "__main__":
    for word in sys.argv[1:]:
        print(digest(Path(word)))
