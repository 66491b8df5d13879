"""Finds episodes by the names that a person types, and declares the options that choose them."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from robot.errors import ConfigurationError, NotFoundError
from robot.recordings.edits import read_notes
from robot.recordings.episode import open_episode
from robot.recordings.store import EpisodeStore
from robot.recordings.teaching import EditedEpisode
from robot.store.folder import Storage, composed, default_root

EPISODE_HELP = "name of an episode or its beginning, a file, or last"


class EpisodeVerb(NamedTuple):
    """A verb that an extension adds to `drivelesson episodes`.

    Attributes:
        changes: True if the verb writes into the data folder; other verbs also work on a read-only
            folder.
        may_create: True if the verb creates a missing data folder.
    """

    help: str
    configure: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, EpisodeStore, Storage], int | None]
    changes: bool = False
    may_create: bool = False


def add_data(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--data", type=Path, default=None, help="data folder of the robot")


def open_data(args: argparse.Namespace, *, changes: bool, may_create: bool = False) -> Storage:
    """Return the data folder that `add_data` declares. A command that only reads creates nothing.

    Raises ConfigurationError if there is no such folder, unless the command may create it.
    """
    root: Path = args.data or default_root()
    is_chosen = args.data is not None or "DRIVELESSON_DATA" in os.environ
    if is_chosen and not may_create and not root.expanduser().is_dir():
        raise ConfigurationError(
            f"there is no data folder {root}; choose the robot's folder with --data FOLDER"
        )
    return Storage(root, creates=changes)


def find_id(store: EpisodeStore, name: str) -> str:
    """Return the id of an episode. `name` is its whole name, or a beginning that no other
    episode's name has, or "last"."""
    ids = store.ids()
    if not ids:
        raise NotFoundError("nothing is recorded yet")
    if name == "last" and name not in ids:
        # choose `last` by the time of recording, because names may sort differently
        return store.summaries()[0].id
    typed = composed(name)
    found = [i for i in ids if i == name] or [i for i in ids if composed(i).startswith(typed)]
    if len(found) != 1:
        what = "no episode matches" if not found else f"{len(found)} episodes match"
        raise NotFoundError(f"{what} {name!r}; list the names with: drivelesson episodes list")
    return found[0]


def add_several(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that choose several episodes; `find_ids` finds the episodes."""
    parser.add_argument("episodes", nargs="*", metavar="EPISODE", help=EPISODE_HELP)
    parser.add_argument("--search", metavar="TEXT", help="all episodes that `list --search` finds")
    parser.add_argument("--all", action="store_true", help="all episodes")


def find_ids(store: EpisodeStore, args: argparse.Namespace) -> list[str]:
    """Return the ids of the episodes that the command line chooses: by name, search, or --all."""
    if sum(map(bool, (args.episodes, args.search, args.all))) > 1:
        raise ConfigurationError("give only one of these: names of episodes, --search, or --all")
    if args.episodes:
        return list(dict.fromkeys(find_id(store, name) for name in args.episodes))
    if not args.all and not args.search:
        raise ConfigurationError("name at least one episode, or give --search or --all")
    found = [one.id for one in store.summaries() if args.all or one.matches(args.search)]
    if not found:
        what = "nothing is recorded yet" if args.all else f"no episode matches {args.search!r}"
        raise NotFoundError(what)
    return found


def find_path(store: EpisodeStore, name: str) -> Path:
    """Return the path `name` if there is such a file, or else the file of the episode `name`."""
    path = Path(name)
    if path.suffix != ".mcap":
        return store.path(find_id(store, name))
    if not path.is_file():
        raise NotFoundError(f"there is no file {name}; see: drivelesson episodes list")
    return path


def find_paths(store: EpisodeStore, names: list[str]) -> list[Path]:
    """Return the files of episodes by name or by file, in the order given, without duplicates."""
    paths = {path.resolve(): path for path in (find_path(store, name) for name in names)}
    return list(paths.values())


def open_all(paths: Iterable[Path]) -> list[EditedEpisode]:
    """Open recordings with their edits."""
    return [(open_episode(path), read_notes(path)) for path in paths]


def find_episodes(store: EpisodeStore, names: list[str]) -> list[EditedEpisode]:
    """Open episodes by name or by file, in the order given, without duplicates."""
    return open_all(find_paths(store, names))
