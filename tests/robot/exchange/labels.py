"""The labels of a recording's examples, by frame."""

from __future__ import annotations

from pathlib import Path

from robot.exchange.drive import Drive, ImportReport
from robot.exchange.sources import find_drives
from robot.exchange.steering import DEFAULT_THRESHOLD
from robot.recordings.episode import Episode, taught_frames
from robot.types import Action


def taught_labels(episode: Episode) -> dict[int, Action]:
    """Return the label of each frame that was taught."""
    return {frame_id: example.label for frame_id, example in taught_frames(episode).items()}


def drive_at(
    path: Path, threshold: float = DEFAULT_THRESHOLD, report: ImportReport | None = None
) -> Drive:
    """Read the one drive at a path."""
    [source] = find_drives(path)
    return source.read(threshold, report or ImportReport())
