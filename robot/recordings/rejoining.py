"""Reunites the files of a recording after an interruption.

A recording is deleted and restored file by file. If the program is killed or loses power meanwhile,
some of the files are in the trash and some are not. To apply the edits to a recording
(`EpisodeStore.compact`), the store moves the original to the trash, and then gives the new file the
original's name. If the program is killed between these two steps, the recording is only in the
trash.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path

from robot.errors import RobotError
from robot.recordings.edits import compacted, notes_path, read_notes, write_notes
from robot.recordings.folder import NAME
from robot.recordings.parts import ENDING, files_of, parts_folder
from robot.recordings.reading import being_read
from robot.store.folder import Storage, move, paths_in
from robot.store.prepare import ASIDE

log = logging.getLogger(__name__)

_COPY = re.compile(r" \(\d+\)\Z", re.ASCII)
"""The suffix, such as ` (2)`, of a restored recording whose own name is in use."""


def strays(folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield the notes and parts whose recording is missing, with the recording's name."""
    found = paths_in(folder)
    names = {path.stem for path in found if path.suffix == ".mcap"}
    for path in found:
        for ending in (".edits.json", ENDING):
            if path.name.endswith(ending) and (name := path.name.removesuffix(ending)) not in names:
                yield path, name


def compacting_mark(path: Path) -> Path:
    """Return the path of the file that marks a recording while its edits are applied. The mark is
    next to the recording at first, and then moves to the trash together with it. The mark has the
    name of an unfinished file, so that the cleanup of such files also removes a mark that was left
    behind."""
    return path.with_name(f".{path.name}.0.part")


def rejoin(storage: Storage) -> None:
    """Move left-over notes and parts to the trash if the rest of their recording is there.

    Parts that were moved to the folder `set-aside` when the server started are moved back to their
    recording. If `EpisodeStore.compact` was interrupted, its recording is repaired. Never raises.
    """
    folder = storage.folder(NAME)
    try:
        _end_compacting(storage, folder)
        for path, name in strays(folder):
            if place := _place_of(path, name, storage):
                move(path, place)
        for path in paths_in(storage.root / ASIDE):
            first = folder / f"{path.name.rpartition(f'{ENDING}.')[0]}.mcap"
            is_free = first.is_file() and not parts_folder(first).exists()
            if is_free and path.is_dir() and not path.is_symlink():
                move(path, parts_folder(first))
    except (OSError, RobotError) as error:
        log.warning("files of a deleted recording were not moved: %s", error)


def _end_compacting(storage: Storage, folder: Path) -> None:
    """Repair recordings for which `EpisodeStore.compact` was interrupted. If the compact copy is
    missing, restore the original. If the copy exists, give it the original's notes, but without the
    edits: they are already applied to the copy."""
    for mark in sorted(storage.trash.glob("*/.*.mcap.0.part")):
        original = mark.with_name(mark.name[1 : -len(".0.part")])
        path = folder / original.name
        if path.name in being_read(folder):
            continue  # another program is compacting this recording now
        if not path.exists() and original.exists():
            storage.restore(mark.parent.name, folder, ".mcap")
            compacting_mark(path).unlink(missing_ok=True)
        elif original.exists() and not notes_path(path).exists():
            write_notes(path, compacted(read_notes(original)))
        mark.unlink(missing_ok=True)


def _place_of(path: Path, name: str, storage: Storage) -> Path | None:
    """Return where a stray file belongs in the trash: next to the first file of its recording."""
    for key in reversed(storage.deleted()):
        for one in (name, _COPY.sub("", name)):
            first = storage.trash / key / f"{one}.mcap"
            place = next(file for file in files_of(first) if file.suffix == path.suffix)
            if first.is_file() and not place.exists():
                return place
    return None
