"""Edits of a recording: a list in a file next to it. The recording itself is not changed."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import UNREADABLE, ConfigurationError, RecordingError
from robot.store.folder import write_whole
from robot.store.records import read_regular
from robot.types import Action

FORMAT = 1
_MOST_BYTES = 16 * 2**20
Range = tuple[int, int]
"""Ids of the first and last frame of a range, both included."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """One edit, which deletes (`delete`) or relabels (`relabel`) ranges of frames."""

    verb: str
    ranges: tuple[Range, ...]
    label: Action | None = None

    def __post_init__(self) -> None:
        if self.verb not in ("delete", "relabel") or (self.verb == "relabel") == (not self.label):
            raise ConfigurationError(f"unknown edit {self.verb!r}; known: delete, relabel")
        if any(first > last for first, last in self.ranges):
            raise ConfigurationError("a range of frames must not end before it begins")

    def covers(self, frame_id: int) -> bool:
        return any(first <= frame_id <= last for first, last in self.ranges)


@dataclass(frozen=True, slots=True, kw_only=True)
class Notes:
    """Data stored next to a recording: its title, whether it is protected from deletion, and its
    edits."""

    title: str = ""
    is_protected: bool = False
    edits: tuple[Edit, ...] = ()
    undone: tuple[Edit, ...] = ()
    """Edits that the person undid and can redo. The edit that was undone last comes first."""

    def with_edit(self, edit: Edit) -> Notes:
        return replace(self, edits=(*self.edits, edit), undone=())

    def without_last_edit(self) -> Notes:
        if not self.edits:
            raise ConfigurationError("there is nothing to undo")
        return replace(self, edits=self.edits[:-1], undone=(self.edits[-1], *self.undone))

    def with_last_undone(self) -> Notes:
        if not self.undone:
            raise ConfigurationError("there is nothing to redo")
        return replace(self, edits=(*self.edits, self.undone[0]), undone=self.undone[1:])

    def is_deleted(self, frame_id: int) -> bool:
        return any(edit.verb == "delete" and edit.covers(frame_id) for edit in self.edits)

    def deleted(self, ids: NDArray[np.integer]) -> NDArray[np.bool_]:
        """Return for each frame whether it is deleted."""
        found = np.zeros(len(ids), bool)
        for first, last in (r for edit in self.edits if edit.verb == "delete" for r in edit.ranges):
            found |= (ids >= first) & (ids <= last)
        return found

    def relabels(self, ids: NDArray[np.integer]) -> list[Action | None]:
        """Return for each frame the last label that a person set; None if no person set a label."""
        if not any(edit.verb == "relabel" for edit in self.edits):
            return [None] * len(ids)
        return [self.relabel(frame_id) for frame_id in ids.tolist()]

    def relabel(self, frame_id: int) -> Action | None:
        """Return the last label that a person set for this frame; None if no person set a label."""
        given = [e.label for e in self.edits if e.verb == "relabel" and e.covers(frame_id)]
        return given[-1] if given else None


def trim(frame_ids: Iterable[int], first: int, last: int) -> Edit:
    """Return the edit that keeps only the frames from `first` to `last`."""
    if first > last:
        raise ConfigurationError("a range of frames must not end before it begins")
    ids = np.sort(np.fromiter(frame_ids, np.int64))
    parts = ids[ids < first], ids[ids > last]
    ranges = tuple((int(part[0]), int(part[-1])) for part in parts if len(part))
    return Edit(verb="delete", ranges=ranges)


def notes_path(episode: Path) -> Path:
    return episode.with_suffix(".edits.json")


def read_notes(episode: Path) -> Notes:
    """Read the notes of a recording; a missing file means empty notes. Raises RecordingError if
    the notes are damaged."""
    path = notes_path(episode)
    try:
        plain = json.loads(read_regular(path, _MOST_BYTES).decode())
        if plain["format"] > FORMAT:
            raise ValueError("a newer version of this program wrote the file")
        return Notes(
            title=str(plain["title"]),
            is_protected=bool(plain["protected"]),
            edits=tuple(map(_edit_from_plain, plain["edits"])),
            undone=tuple(map(_edit_from_plain, plain.get("undone", ()))),
        )
    except FileNotFoundError:
        return Notes()
    except (*UNREADABLE, OSError) as error:
        raise RecordingError(
            f"{path.name} is damaged: {error}; repair it or move it away"
        ) from error


def compacted(notes: Notes) -> Notes:
    """Return the notes for the copy that replaces a recording. The notes contain no edits, because
    the edits are already applied to the copy."""
    return replace(notes, edits=(), undone=())


def write_notes(episode: Path, notes: Notes) -> None:
    plain = {
        "format": FORMAT,
        "title": notes.title,
        "protected": notes.is_protected,
        "edits": [asdict(edit) for edit in notes.edits],
        "undone": [asdict(edit) for edit in notes.undone],
    }
    text = json.dumps(plain, indent=1, ensure_ascii=False)
    # a shell may pass surrogates, which UTF-8 cannot encode
    write_whole(notes_path(episode), text.encode(errors="replace"))


def _edit_from_plain(plain: Any) -> Edit:
    return Edit(
        verb=plain["verb"],
        ranges=tuple((int(first), int(last)) for first, last in plain["ranges"]),
        label=Action(plain["label"]) if plain["label"] else None,
    )
