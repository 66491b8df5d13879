"""A cache of episode summaries: each file is read once for each state that it has.

A cache beside the recordings, `episodes/.index.json`: rebuilt when it is missing, damaged or of
another form, and entry by entry where a file is not the one that was described.
"""

from __future__ import annotations

import json
import logging
import os
import zlib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from robot.store.episodes.edits import notes_path
from robot.store.episodes.summary import EpisodeSummary, read_head, read_summary
from robot.store.folder import is_text, write_whole
from robot.store.records import read_regular

log = logging.getLogger(__name__)

FORMAT = 1
_MOST_BYTES = 256 * 2**20
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
        states = self._look()
        is_changed = len(self._known) != len(states)
        known: dict[str, tuple[State, EpisodeSummary]] = {}
        for episode_id, state in states.items():
            found = self._known.get(episode_id)
            if found is None or found[0] != state:
                summary = self._describe(episode_id, state)
                if summary is None:
                    continue
                found = state, summary
                is_changed = is_changed or episode_id != self._recording()
            known[episode_id] = found
        self._known = known
        if is_changed:
            self._save()
        found_now = [summary for _, summary in known.values()]
        return sorted(found_now, key=lambda s: (s.started_at_s, s.id), reverse=True)

    def get(self, path: Path) -> EpisodeSummary:
        """Describe one recording; raises OSError if it is not there."""
        self._load()
        status = path.stat()
        state = (status.st_size, status.st_mtime_ns, *_state_of(notes_path(path)))
        found = self._known.get(path.stem)
        if found is not None and found[0] == state:
            return found[1]
        summary = self._describe(path.stem, state)
        if summary is None:
            raise FileNotFoundError(path)
        self._known[path.stem] = state, summary
        return summary

    def ids(self) -> list[str]:
        """Name all recordings; nothing is read."""
        return list(self._look())

    def _look(self) -> dict[str, State]:
        """Find every recording and its state in one pass over the folder."""
        recordings: dict[str, tuple[int, int]] = {}
        notes: dict[str, tuple[int, int]] = {}
        try:
            with os.scandir(self._folder) as entries:
                for entry in entries:
                    name = entry.name
                    ending = next((e for e in (".mcap", ".edits.json") if name.endswith(e)), None)
                    if ending is None or name.startswith(".") or not is_text(name):
                        continue
                    try:
                        if not entry.is_file():
                            continue
                        status = entry.stat()
                    except OSError:
                        continue
                    found = recordings if ending == ".mcap" else notes
                    found[name.removesuffix(ending)] = status.st_size, status.st_mtime_ns
        except OSError as error:
            log.warning("the folder of episodes cannot be read: %s", error)
        return {i: (*state, *notes.get(i, (0, 0))) for i, state in recordings.items()}

    def _describe(self, episode_id: str, state: State) -> EpisodeSummary | None:
        path = self._folder / f"{episode_id}.mcap"
        is_growing = episode_id == self._recording() and state[0] > _READ_WHOLE_BYTES
        try:
            return read_head(path) if is_growing else read_summary(path)
        except OSError:
            return None

    def _load(self) -> None:
        if self._is_loaded:
            return
        self._is_loaded = True
        try:
            checksum, _, text = read_regular(self._file, _MOST_BYTES).partition(b"\n")
            if int(checksum) != zlib.crc32(text):
                raise ValueError("its checksum does not match")
            plain = json.loads(text)
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
            write_whole(self._file, str(zlib.crc32(text)).encode() + b"\n" + text)
        except OSError as error:
            log.warning("the index of episodes was not saved: %s", error)


def _state_of(path: Path) -> tuple[int, int]:
    try:
        status = path.stat()
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns
