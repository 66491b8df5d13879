"""Lists, opens, edits, deletes and restores the recordings of one robot."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from robot.clock import RealClock
from robot.errors import ConfigurationError, NotFoundError, RecordingError, told_as
from robot.recordings.editing import EditedWriter, write_edited
from robot.recordings.edits import (
    Edit,
    Notes,
    compacted,
    notes_path,
    read_notes,
    trim,
    write_notes,
)
from robot.recordings.episode import Episode, open_episode
from robot.recordings.folder import NAME
from robot.recordings.parts import ENDING, files_of, has_ended, state_of
from robot.recordings.reading import being_read, reading
from robot.recordings.rejoining import compacting_mark
from robot.recordings.summary import EpisodeSummary, read_summary
from robot.recordings.trash import remove_old
from robot.store.folder import Storage, check_name, free_name, paths_in, size_of, whole_file
from robot.store.lock import FolderLock
from robot.store.presence import require_present

DEFAULT_BUDGET_BYTES = 8 * 2**30
_ENDINGS = re.compile(rf"(\.mcap|\.edits\.json|{re.escape(ENDING)})\Z")
_OPEN_EPISODES, _DESCRIBED = 2, 2**16
"""Maximum numbers of open recordings and of list entries in the caches."""
_READ_WHOLE_BYTES = 2 * 2**20
"""Size above which only the beginning of a recording in progress is read, in bytes."""


_MACHINE = RealClock()


@dataclass(frozen=True, slots=True, kw_only=True)
class Deleted:
    """The outcome of a deletion: the deleted episodes, the key that restores all of them, and the
    reasons why other episodes were not deleted."""

    ids: tuple[str, ...]
    key: str | None
    kept: Mapping[str, str]


class EpisodeStore:
    """All file operations on episodes, except recording. Thread-safe."""

    def __init__(
        self,
        storage: Storage,
        recording: Callable[[], str | None] | None = None,
        write: EditedWriter = write_edited,
        wall_s: Callable[[], float] = _MACHINE.wall_s,
    ) -> None:
        self._storage, self._write, self._wall_s = storage, write, wall_s
        self._recording = recording or (lambda: None)
        self._is_recorder = recording is not None  # False: another program may be recording
        self.budget_bytes = DEFAULT_BUDGET_BYTES
        """If the total size of all episodes exceeds this number, the oldest unprotected episodes
        are offered for deletion."""
        self._lock = threading.RLock()
        self._listing = threading.Lock()
        self._open = lru_cache(_OPEN_EPISODES)(lambda path, *state: open_episode(path))
        self._read = lru_cache(_DESCRIBED)(
            lambda path, is_growing, *state: read_summary(path, is_growing=is_growing)
        )

    def ids(self) -> list[str]:
        """Return the episodes' names in descending order."""
        return sorted((path.stem for path in self._paths()), reverse=True)

    def summaries(self) -> list[EpisodeSummary]:
        """Describe all episodes, newest first; a file is read again only if it changed."""
        found = []
        for path in self._paths():
            with contextlib.suppress(OSError):  # the file was deleted
                found.append(self._describe(path))
        return sorted(found, key=lambda s: (-s.started_at_s, s.is_copy, len(s.id), s.id))

    def summary(self, episode_id: str) -> EpisodeSummary:
        """Describe one episode; raises OSError if its file is missing."""
        return self._describe(self.path(episode_id))

    def _paths(self) -> list[Path]:
        found = [path for path in paths_in(self._storage.folder(NAME)) if path.suffix == ".mcap"]
        return [path for path in found if path.is_file() and size_of(path) and path.name[0] != "."]

    def _describe(self, path: Path) -> EpisodeSummary:
        """Describe a recording; read it only if it or its notes have changed."""
        notes = notes_path(path)
        state = state_of(path)
        size = sum(size for size, _ in state)
        is_growing = path.stem == self._recording() and size > _READ_WHOLE_BYTES
        about = state_of(notes) if notes.exists() else None
        with self._listing:
            return self._read(path, is_growing, state, about)

    def path(self, episode_id: str) -> Path:
        is_name = not episode_id.startswith(".") and not set(episode_id) & set("/\\\0")
        path = self._storage.folder(NAME) / f"{episode_id}.mcap"
        with contextlib.suppress(OSError, ValueError):  # the id is not a valid file name
            if is_name and episode_id and path.is_file():
                return path
        raise NotFoundError(f"unknown episode {episode_id[:80]!r}")

    def open(self, episode_id: str) -> Episode:
        """Open an episode; the last two episodes stay open."""
        path = self.path(episode_id)
        state = state_of(path)
        with self._lock:
            return self._open(path, state)

    def notes(self, episode_id: str) -> Notes:
        return read_notes(self.path(episode_id))

    def edit(self, episode_id: str, edit: Edit) -> Notes:
        return self._change(episode_id, lambda notes: notes.with_edit(edit))

    def undo_edit(self, episode_id: str) -> Notes:
        return self._change(episode_id, Notes.without_last_edit)

    def redo_edit(self, episode_id: str) -> Notes:
        return self._change(episode_id, Notes.with_last_undone)

    def set_title(self, episode_id: str, title: str) -> Notes:
        return self._change(episode_id, lambda notes: replace(notes, title=title.strip()[:200]))

    def protect(self, episode_id: str, is_protected: bool) -> Notes:
        return self._change(episode_id, lambda notes: replace(notes, is_protected=is_protected))

    def _change(self, episode_id: str, change: Callable[[Notes], Notes]) -> Notes:
        with self._lock:
            path = self.path(episode_id)
            notes = change(read_notes(path))
            write_notes(path, notes)
            return notes

    def delete(self, *episode_ids: str) -> Deleted:
        """Move episodes to the trash together, except those that cannot be deleted now.

        Raises ConfigurationError if only one episode is given and it cannot be deleted.
        """
        wanted = list(dict.fromkeys(episode_ids))
        paths: dict[str, Path] = {}
        kept: dict[str, str] = {}
        for episode_id in wanted:
            try:
                paths[episode_id] = self._deletable(episode_id)
            except (ConfigurationError, NotFoundError, RecordingError) as error:
                if len(wanted) == 1:
                    raise
                kept[episode_id] = str(error)
        files = [file for path in paths.values() for file in files_of(path)]
        self.remove_old_trash()
        key = self._storage.discard(*files) if files else None
        return Deleted(ids=tuple(paths), key=key, kept=kept)

    def remove_old_trash(self) -> None:
        """Remove items that have been in the trash for `TRASH_DAYS`."""
        remove_old(self._storage, self._wall_s())

    def _deletable(self, episode_id: str) -> Path:
        path = self._idle_path(episode_id)
        if read_notes(path).is_protected:
            raise ConfigurationError("this recording is protected; remove the protection first")
        return path

    def restore(self, key: str) -> list[str]:
        """Restore the episodes that one deletion removed, and return their names. An episode whose
        old name is in use gets a new name."""
        with self._lock:
            return self._storage.restore(key, self._storage.folder(NAME), ".mcap")

    def trash(self) -> list[str]:
        """Return the keys of the deleted episodes, in the order of deletion."""
        trash = self._storage.trash
        return [key for key in self._storage.deleted() if any((trash / key).glob("*.mcap"))]

    def compact(self, episode_id: str) -> str:
        """Replace a recording by a copy with its edits applied. Return the key that restores the
        original."""
        with self._lock:
            path = self._idle_path(episode_id)
            notes, episode, key = read_notes(path), self.open(episode_id), ""
            mark = compacting_mark(path)
            try:
                with reading([path]), whole_file(path) as file:
                    self._write(episode, notes, file)
                    if self.open(episode_id) is not episode or read_notes(path) != notes:
                        raise ConfigurationError(
                            "this episode was changed while its edits were applied; try again"
                        )
                    mark.touch()
                    key = self._storage.discard(mark, *files_of(path))
            except BaseException:
                if key:
                    self.restore(key)
                mark.unlink(missing_ok=True)
                raise
            write_notes(path, compacted(notes))
            (self._storage.trash / key / mark.name).unlink(missing_ok=True)
            return key

    def split(self, episode_id: str, frame_id: int) -> str:
        """Split a recording: a second recording begins with this frame. Return its name.

        The first file stays complete; an edit deletes the second recording's frames from it. Raises
        ConfigurationError if one of the two recordings would be empty.
        """
        with self._lock:
            path = self._idle_path(episode_id)
            notes, episode = read_notes(path), self.open(episode_id)
            kept = episode.frames.ids[~notes.deleted(episode.frames.ids)]
            before, after = kept[kept < frame_id].tolist(), kept[kept >= frame_id].tolist()
            if not before or not after:
                raise ConfigurationError(
                    "a recording cannot be split there: one of the two parts would have no pictures"
                )
            second = notes.with_edit(trim(episode.frames, after[0], after[-1]))
            with self.new_file(f"{episode_id[:60]}-2") as new:
                with whole_file(new) as file:
                    self._write(episode, second, file, is_part=True)
                if notes.title:
                    write_notes(new, Notes(title=f"{notes.title} 2"))
                self.edit(episode_id, trim(episode.frames, before[0], before[-1]))
            return new.stem

    @contextlib.contextmanager
    def new_file(self, name: str) -> Iterator[Path]:
        """Reserve a path with `new_path` for a writer; release the path if the writer fails."""
        path = self.new_path(name)
        try:
            yield path
        except BaseException:
            path.unlink(missing_ok=True)
            raise

    def new_path(self, name: str) -> Path:
        """Reserve a free path by creating an empty file there, because another program may choose
        the same path.

        A name is also taken if only the notes of a deleted recording still have it. If a deleted
        recording's name were free, the edits in its notes would apply to the new recording.
        """
        require_present(self._storage.folder(NAME))
        names = (path.name for path in paths_in(self._storage.folder(NAME)))
        taken = {_ENDINGS.sub("", name) for name in names}
        while True:
            path = self._storage.folder(NAME) / f"{free_name(check_name(name), taken)}.mcap"
            with contextlib.suppress(FileExistsError):
                path.touch(exist_ok=False)
                return path
            taken.add(path.stem)

    def offered(self) -> list[EpisodeSummary]:
        """Return the episodes that would have to be deleted to meet the budget. None is deleted
        automatically."""
        summaries, offered = self.summaries(), []
        excess = sum(summary.bytes for summary in summaries) - self.budget_bytes
        for summary in reversed(summaries):
            if excess <= 0:
                break
            if not summary.is_protected and summary.id != self._recording():
                offered.append(summary)
                excess -= summary.bytes
        return offered

    def _idle_path(self, episode_id: str) -> Path:
        if episode_id == self._recording():
            raise ConfigurationError("this episode is being recorded; stop the robot and wait")
        path = self.path(episode_id)
        if path.name in being_read(path.parent):
            raise ConfigurationError(
                "this recording is being downloaded, exported or used for training; wait and retry"
            )
        if self._is_recorder or has_ended(path):
            return path
        unfinished = told_as(ConfigurationError, "this episode is not finished", ConfigurationError)
        with unfinished, FolderLock(self._storage.root):
            return path
