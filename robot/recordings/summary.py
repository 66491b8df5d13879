"""An episode's list entry, read only from the beginning and the end of its files."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from robot.errors import UNREADABLE, RecordingError
from robot.recordings.edits import Notes, read_notes
from robot.recordings.episode import open_episode, seconds_in, taught_frames
from robot.recordings.messages import CONTINUES, RUN, SUMMARY
from robot.recordings.parts import part_paths, state_of
from robot.recordings.reader import CUT_SHORT, Metadata, read_metadata, scan
from robot.recordings.writer import describe_content
from robot.store.folder import fold


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeSummary:
    """One recording, as the list of recordings shows it. `started_at_s` is in seconds since 1970.

    `damage` says that the file is truncated, or why it cannot be read (then `is_readable` is
    False).
    """

    id: str
    bytes: int
    title: str = ""
    is_protected: bool = False
    edits: int = 0
    started_at_s: float = 0.0
    duration_s: float = 0.0
    frames: int = 0
    taught: Mapping[str, int]
    robot: str = ""
    learner: str = ""
    source: str = ""
    is_readable: bool = True
    damage: str | None = None
    is_copy: bool = False
    """True if the file has another name than when it was recorded. A file with another name is
    usually a copy."""

    def matches(self, text: str) -> bool:
        """True if each word of `text` occurs in the name, title, date, labels, robot or learner of
        the recording."""
        began = datetime.fromtimestamp(self.started_at_s).isoformat(" ", "seconds")
        about = (self.id, self.title, began, *self.taught, self.robot, self.learner, self.source)
        haystack = fold(" ".join(about))
        return all(word in haystack for word in fold(text).split())


def read_summary(path: Path, *, is_growing: bool = False) -> EpisodeSummary:
    """Describe a recording, even a damaged one; raises OSError only if the file is missing.

    If `is_growing`, only the beginning is read.
    """
    size = sum(size for size, _ in state_of(path))
    try:
        notes, complaint = read_notes(path), None
    except RecordingError as error:
        notes, complaint = Notes(), str(error)
    try:
        facts = _read_head(path) if is_growing else _read_ends(path)
    except (RecordingError, ValueError, OSError) as error:
        facts = {"is_readable": False, "damage": str(error), "taught": {}}
    if complaint:
        facts["damage"] = complaint
    return EpisodeSummary(
        id=path.stem,
        bytes=size,
        title=notes.title,
        is_protected=notes.is_protected,
        edits=len(notes.edits),
        is_copy=facts.pop("episode", "") not in ("", path.stem),
        **facts,
    )


def _read_head(path: Path) -> dict[str, Any]:
    for record in scan(path):
        if isinstance(record, Metadata) and record.name == RUN:
            written_s = max(written_ns for _, written_ns in state_of(path)) / 1e9
            lasted_s = written_s - seconds_in(record.values.get("started_at_s", "0"))
            return _facts(record.values, describe_content(0, {}, lasted_s))
    raise RecordingError("the beginning of the recording is not written yet")


def _read_ends(path: Path) -> dict[str, Any]:
    """Read the counts from the metadata at the end of the last file, or count the content if the
    metadata are damaged."""
    files = part_paths(path)
    last = max(files)
    with contextlib.suppress(*UNREADABLE, OSError):
        metadata = read_metadata(path)
        if last + 1 == len(files):
            end = metadata[SUMMARY] if last == 0 else read_metadata(files[last])[SUMMARY]
            if CONTINUES in end:
                end = {"damage": CUT_SHORT, **end}
            return _facts(metadata[RUN], end)
    episode = open_episode(path)
    taught = taught_frames(episode).counts
    content = describe_content(len(episode.frames), taught, episode.duration_s)
    return {**_facts(episode.run, content), "damage": episode.damage}


def _facts(run: Mapping[str, str], content: Mapping[str, str]) -> dict[str, Any]:
    return {
        "episode": run.get("episode", ""),
        "started_at_s": seconds_in(run.get("started_at_s", "0")),
        "robot": run.get("robot", ""),
        "learner": run.get("learner", ""),
        "source": run.get("source", ""),
        "duration_s": seconds_in(content["duration_s"]),
        "frames": int(content["frames"]),
        "taught": {str(k): int(v) for k, v in json.loads(content["taught"]).items()},
        "damage": content.get("damage"),
    }
