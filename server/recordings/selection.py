"""Finds episodes by a typed name, and declares the option for the data folder."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from robot.errors import NotFoundError
from robot.recordings.edits import read_notes
from robot.recordings.episode import open_episode
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import EditedEpisode
from robot.store.folder import Storage, composed

EPISODE_HELP = "name, beginning of a name, file, or last"


class EpisodeVerb(NamedTuple):
    """A verb that an extension adds to `drivelesson episodes`."""

    help: str
    configure: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, EpisodeStore, Storage], int | None]


def add_data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--data", type=Path, default=None, help="folder for what is kept")


def find_id(store: EpisodeStore, name: str) -> str:
    """Return the id of the episode with this name, or the only one that begins with it."""
    ids = store.ids()
    if not ids:
        raise NotFoundError("nothing is recorded yet")
    if name == "last" and name not in ids:
        return store.summaries()[0].id  # by its time, and never by its name
    typed = composed(name)
    found = [i for i in ids if i == name] or [i for i in ids if composed(i).startswith(typed)]
    if len(found) != 1:
        what = "no episode" if not found else f"{len(found)} episodes"
        raise NotFoundError(f"{what} of this name: {name!r}; see: drivelesson episodes list")
    return found[0]


def find_path(store: EpisodeStore, name: str) -> Path:
    """Return the file of this name, or that of an episode."""
    path = Path(name)
    is_file = path.suffix == ".mcap" and path.is_file()
    return path if is_file else store.path(find_id(store, name))


def find_episodes(store: EpisodeStore, names: list[str]) -> list[EditedEpisode]:
    """Open episodes by name or by file, in the order given, without duplicates."""
    paths = {path.resolve(): path for path in (find_path(store, name) for name in names)}
    return [(open_episode(path), read_notes(path)) for path in paths.values()]
