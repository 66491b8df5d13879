"""A cache of episode summaries: each file is read once for each state that it has.

A cache beside the recordings, `episodes/.index.json`: rebuilt when it is missing, damaged or of
another form, and entry by entry where a file is not the one that was described.
"""

from __future__ import annotations

import contextlib
import json
import logging
import stat
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from robot.store.episodes.edits import notes_path
from robot.store.episodes.summary import EpisodeSummary, read_head, read_summary
from robot.store.folder import paths_in, write_whole
from robot.store.records import frame_record, read_records

log = logging.getLogger(__name__)

FORMAT = 2
_READ_WHOLE_BYTES = 2 * 2**20
"""Of a recording that is being written only the beginning is read once it is larger."""
_FIELDS = tuple(field.name for field in fields(EpisodeSummary))
State = tuple[int, int, int, int]
"""Bytes and time of change, of a recording and of its notes: what tells a described file."""


class SummaryIndex:
    """Describes the recordings of a folder. For one thread at a time."""

    def __init__(self, folder: Path, recording: Callable[[], str | None]) -> None:
        self._folder = folder
        self._file = folder / ".index.json"
        self._recording = recording
        self._known: dict[str, tuple[State, EpisodeSummary]] = {}
        self._is_loaded = False

    def summaries(self) -> list[EpisodeSummary]:
        """Describe all recordings, the newest by time first."""
        self._load()
        found = {name: self._described(name, state) for name, state in self._look().items()}
        known = {name: one for name, one in found.items() if one is not None}
        before, self._known = self._known, known
        growing = self._recording()
        if any(before.get(name) != known.get(name) for name in {*before, *known} - {growing}):
            self._save()
        return sorted(
            (summary for _, summary in known.values()),
            key=lambda summary: (summary.started_at_s, summary.id),
            reverse=True,
        )

    def get(self, path: Path) -> EpisodeSummary:
        """Describe one recording; raises OSError if it is not there."""
        self._load()
        state = _state_of(path)
        found = self._described(path.stem, state) if state is not None else None
        if found is None:
            raise FileNotFoundError(path)
        self._known[path.stem] = found
        return found[1]

    def ids(self) -> list[str]:
        """Name all recordings; nothing is read."""
        return list(self._look())

    def _look(self) -> dict[str, State]:
        found = {
            path.stem: _state_of(path)
            for path in paths_in(self._folder)
            if path.suffix == ".mcap" and not path.name.startswith(".")
        }
        return {episode_id: state for episode_id, state in found.items() if state is not None}

    def _described(self, episode_id: str, state: State) -> tuple[State, EpisodeSummary] | None:
        known = self._known.get(episode_id)
        if known is not None and known[0] == state:
            return known
        path = self._folder / f"{episode_id}.mcap"
        is_growing = episode_id == self._recording() and state[0] > _READ_WHOLE_BYTES
        try:
            return state, read_head(path) if is_growing else read_summary(path)
        except OSError:
            return None

    def _load(self) -> None:
        if self._is_loaded:
            return
        self._is_loaded = True
        try:
            plain = json.loads(next(read_records(self._file), b""))
            if plain["format"] != FORMAT:
                return
            for state, facts in plain["episodes"]:
                summary = EpisodeSummary(**facts)
                self._known[summary.id] = tuple(state), summary
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            log.warning("the index of episodes is rebuilt: %s", error)
            self._known.clear()

    def _save(self) -> None:
        """Write the index; where that cannot be it is built again at the next start."""
        recording = self._recording()
        episodes: list[Any] = [
            [state, {name: getattr(summary, name) for name in _FIELDS}]
            for episode_id, (state, summary) in self._known.items()
            if episode_id != recording
        ]
        text = json.dumps({"format": FORMAT, "episodes": episodes}).encode()
        try:
            write_whole(self._file, frame_record(text))
        except OSError as error:
            log.warning("the index of episodes was not saved: %s", error)


def _state_of(path: Path) -> State | None:
    """Return the state of a recording and of its notes; None if it is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    if not stat.S_ISREG(status.st_mode):
        return None
    state = status.st_size, status.st_mtime_ns
    with contextlib.suppress(OSError):
        beside = notes_path(path).stat()
        return *state, beside.st_size, beside.st_mtime_ns
    return *state, 0, 0
