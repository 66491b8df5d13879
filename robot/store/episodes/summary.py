"""What a list of episodes shows, read from the two ends of a file without going through it."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.errors import UNREADABLE, RecordingError
from robot.store.episodes.edits import Notes, read_notes
from robot.store.episodes.episode import open_episode, taught_frames
from robot.store.episodes.messages import RUN, SUMMARY
from robot.store.episodes.reader import Metadata, read_metadata, scan


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeSummary:
    """One recording of the list. `started_at_s` is wall-clock time, seconds since 1970.

    `damage` says what is wrong: where a file that was cut short ends, or why a file cannot be read
    at all (`is_readable` is False).
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


def read_summary(path: Path) -> EpisodeSummary:
    """Describe a recording, whatever state it is in; only a missing file raises (OSError)."""
    size = path.stat().st_size
    try:
        notes, complaint = read_notes(path), None
    except RecordingError as error:
        notes, complaint = Notes(), str(error)
    try:
        facts = _read_ends(path) or _count(path)
    except (RecordingError, ValueError, OSError) as error:
        facts = {"is_readable": False, "damage": str(error)}
    facts.setdefault("taught", {})
    if complaint:
        facts["damage"] = complaint
    return EpisodeSummary(
        id=path.stem,
        bytes=size,
        title=notes.title,
        is_protected=notes.is_protected,
        edits=len(notes.edits),
        **facts,
    )


def read_head(path: Path) -> EpisodeSummary:
    """Describe a recording that is being written by its beginning alone; raises OSError."""
    status = path.stat()
    for record in scan(path):
        if isinstance(record, Metadata) and record.name == RUN:
            facts = _facts_of_run(record.values)
            duration_s = max(status.st_mtime - facts["started_at_s"], 0.0)
            return EpisodeSummary(
                id=path.stem, bytes=status.st_size, duration_s=duration_s, taught={}, **facts
            )
    return EpisodeSummary(id=path.stem, bytes=status.st_size, taught={}, is_readable=False)


def _read_ends(path: Path) -> dict[str, Any] | None:
    """Read the metadata at the end of the file; None if its end is missing."""
    try:
        metadata = read_metadata(path)
        return _facts(metadata[RUN], metadata[SUMMARY])
    except (*UNREADABLE, OSError):
        return None


def _count(path: Path) -> dict[str, Any]:
    """Count what a recording without a sound end holds."""
    episode = open_episode(path)
    return {
        **_facts_of_run(episode.run),
        "duration_s": round(episode.duration_s, 6),
        "frames": len(episode.frames),
        "taught": dict(Counter(each.label.value for each in taught_frames(episode).values())),
        "damage": episode.damage,
    }


def _facts(run: Mapping[str, str], summary: Mapping[str, str]) -> dict[str, Any]:
    return {
        **_facts_of_run(run),
        "duration_s": _finite(summary["duration_s"]),
        "frames": int(summary["frames"]),
        "taught": {str(k): int(v) for k, v in json.loads(summary["taught"]).items()},
        "damage": summary.get("damage"),
    }


def _facts_of_run(run: Mapping[str, str]) -> dict[str, Any]:
    return {
        "started_at_s": _finite(run.get("started_at_s", "0")),
        "robot": run.get("robot", ""),
        "learner": run.get("learner", ""),
        "source": run.get("source", ""),
    }


def _finite(text: str) -> float:
    """Read a number; raises ValueError for one that no answer could hold."""
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text!r} is not a finite number")
    return number
