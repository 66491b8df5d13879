"""What a list of episodes shows, read from the two ends of a file without going through it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.errors import RecordingError
from robot.store.episodes.edits import Notes, read_notes
from robot.store.episodes.ends import read_metadata
from robot.store.episodes.episode import Episode, open_episode, taught_frames
from robot.store.episodes.scan import Metadata, scan
from robot.store.episodes.tally import count_cut_recording
from robot.store.episodes.writer import RUN, SUMMARY

_UNUSABLE = (
    RecordingError,
    KeyError,
    ValueError,
    OSError,
    AttributeError,
    TypeError,
    RecursionError,
)
"""What reading a damaged summary may raise; the whole file is then read instead."""


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
        facts = _read_ends(path) or _count_cut(path) or _read_all(open_episode(path))
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
        run, summary = metadata[RUN], metadata[SUMMARY]
        return {
            **_facts_of_run(run),
            "duration_s": _finite(summary["duration_s"]),
            "frames": int(summary["frames"]),
            "taught": {str(k): int(v) for k, v in json.loads(summary["taught"]).items()},
        }
    except _UNUSABLE:
        return None


def _count_cut(path: Path) -> dict[str, Any] | None:
    """Count what a recording holds that was cut short; None if it is anything else."""
    tally = count_cut_recording(path)
    if tally is None:
        return None
    return {
        **_facts_of_run(tally.run),
        "duration_s": tally.duration_s,
        "frames": len(tally.frames),
        "taught": dict(tally.taught),
        "damage": tally.damage,
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


def _read_all(episode: Episode) -> dict[str, Any]:
    """Go through a recording that is damaged, or that another program wrote."""
    taught: dict[str, int] = {}
    for label in taught_frames(episode).values():
        taught[label.value] = taught.get(label.value, 0) + 1
    return {
        **_facts_of_run(episode.run),
        "duration_s": episode.duration_s,
        "frames": len(episode.frames),
        "taught": taught,
        "damage": episode.damage,
    }
