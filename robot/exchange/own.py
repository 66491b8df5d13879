"""Imports a recording that this program made on another robot: the file is copied unchanged."""

from __future__ import annotations

import os
from pathlib import Path

from robot.errors import RecordingError, told_as
from robot.exchange.drive import ImportReport
from robot.recordings import copying
from robot.recordings.edits import notes_path, read_notes, write_notes
from robot.recordings.episode import open_episode, taught_frames
from robot.recordings.messages import RUN
from robot.recordings.reader import MAGIC
from robot.store.folder import whole_file

SOURCE = "recording of another robot"
_ENDS_BYTES = 2**16


def is_own(path: Path) -> bool:
    """True for a recording of this program, even if another program has rewritten it."""
    with told_as(RecordingError, f"{path} cannot be read"), path.open("rb") as file:
        head = file.read(_ENDS_BYTES)
        file.seek(max(0, file.seek(0, os.SEEK_END) - _ENDS_BYTES))
        return head.startswith(MAGIC) and RUN.encode() in head + file.read()


def copy_recording(path: Path, target: Path, report: ImportReport) -> int:
    """Copy a recording with its edits; return its number of pictures.

    The copy is marked as imported. A truncated recording is copied as far as it is readable. Raises
    RecordingError if the recording is damaged at its beginning or has no pictures.
    """
    episode = open_episode(path)
    if episode.damage:
        report.skip(path.name, episode.damage)
    if not episode.frames:
        raise RecordingError(f"{path} has no pictures")
    run = {**episode.run, "source": SOURCE}
    with whole_file(target) as file:
        for _ in copying.copy_recording(episode, file, run):
            pass
    if notes_path(path).is_file():
        write_notes(target, read_notes(path))
    report.labels.update(example.label for example in taught_frames(episode).values())
    seconds = episode.duration_s
    report.rate = len(episode.frames) / seconds if seconds else 0.0
    return len(episode.frames)
