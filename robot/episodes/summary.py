"""What a list of episodes shows, read from the two ends of a file without going through it."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot.episodes.edits import Notes, read_notes
from robot.episodes.episode import Episode, open_episode, taught_frames
from robot.episodes.scan import records_from
from robot.episodes.writer import RUN, SUMMARY
from robot.errors import RecordingError

_FOOTER = struct.Struct("<BQQQI8s")
_FOOTER_OPCODE, _FOOTER_LENGTH = 0x02, 20
_METADATA_INDEX, _MOST_SUMMARY_BYTES = "MetadataIndex", 16 * 2**20


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeSummary:
    """One recording of the list. `started_at_s` is wall-clock time, seconds since 1970.

    `damage` says what is wrong: of one that was cut short, where it ends; of one that cannot be
    read at all (`is_readable` is False), why.
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


def read_card(path: Path) -> EpisodeSummary:
    """Describe a recording, whatever state it is in; only a missing file raises (OSError)."""
    size = path.stat().st_size
    try:
        notes, complaint = read_notes(path), None
    except RecordingError as error:
        notes, complaint = Notes(), str(error)
    try:
        found = _read_ends(path, size)
        facts = found if found is not None else _read_all(open_episode(path))
    except RecordingError as error:
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


def _read_ends(path: Path, size: int) -> dict[str, Any] | None:
    """Read what the file says of itself at its end; None if it has no such end."""
    try:
        metadata = _metadata(path, size)
        run, summary = metadata[RUN], metadata[SUMMARY]
        return {
            **_facts_of_run(run),
            "duration_s": float(summary["duration_s"]),
            "frames": int(summary["frames"]),
            "taught": {str(k): int(v) for k, v in json.loads(summary["taught"]).items()},
        }
    except (RecordingError, KeyError, ValueError, AttributeError, TypeError, RecursionError):
        return None


def _metadata(path: Path, size: int) -> dict[str, dict[str, str]]:
    """Follow the footer to the index, and the index to the metadata records."""
    if size < _FOOTER.size:
        raise RecordingError("too short")
    with path.open("rb") as file:
        file.seek(size - _FOOTER.size)
        opcode, length, summary_start, _, _, _ = _FOOTER.unpack(file.read(_FOOTER.size))
    if (opcode, length) != (_FOOTER_OPCODE, _FOOTER_LENGTH):
        raise RecordingError("no footer")
    if not 8 <= summary_start < size or size - summary_start > _MOST_SUMMARY_BYTES:
        raise RecordingError("no summary")
    found = {}
    for record in records_from(path, summary_start):
        if type(record).__name__ == _METADATA_INDEX and record.name in (RUN, SUMMARY):
            metadata = next(iter(records_from(path, record.offset)))
            found[record.name] = dict(metadata.metadata)
    return found


def _facts_of_run(run: Mapping[str, str]) -> dict[str, Any]:
    return {
        "started_at_s": float(run.get("started_at_s", "0")),
        "robot": run.get("robot", ""),
        "learner": run.get("learner", ""),
        "source": run.get("source", ""),
    }


def _read_all(episode: Episode) -> dict[str, Any]:
    """Go through a recording that was cut short."""
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
