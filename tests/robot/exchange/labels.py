"""The labels of a recording's examples, by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robot.exchange.drive import Drive, ImportReport
from robot.exchange.reading import Reading
from robot.exchange.sources import find_drives
from robot.recordings.episode import Episode, taught_frames
from robot.types import Action


def taught_labels(episode: Episode) -> dict[int, Action]:
    """Return the label of each frame that was taught."""
    return {frame_id: example.label for frame_id, example in taught_frames(episode).items()}


def drive_at(path: Path, report: ImportReport | None = None, **reading: Any) -> Drive:
    """Read the single drive at a path."""
    [source] = find_drives(path)
    return source.read(Reading(**reading), report or ImportReport())
