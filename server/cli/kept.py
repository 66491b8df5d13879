"""Find episodes by what was typed, and the option for the data folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot.episodes.edits import read_notes
from robot.episodes.episode import open_episode
from robot.episodes.store import EpisodeStore
from robot.episodes.teaching import EditedEpisode
from robot.errors import NotFoundError

EPISODE_HELP = "name, beginning of a name, file, or last"


def add_data(parser: argparse.ArgumentParser) -> None:
    """Declare the data folder."""
    parser.add_argument("--data", type=Path, default=None, help="folder for what is kept")


def find_id(store: EpisodeStore, name: str) -> str:
    """Return the id of the episode with this name, or the only one that begins with it.

    Raises:
        NotFoundError: If there is none, or more than one.
    """
    ids = store.ids()
    if name == "last" and name not in ids:
        return find_last(store)
    found = [i for i in ids if i == name] or [i for i in ids if i.startswith(name)]
    if len(found) != 1:
        what = "no episode" if not found else f"{len(found)} episodes"
        raise NotFoundError(f"{what} of this name: {name!r}; see: drivelesson episodes list")
    return found[0]


def find_last(store: EpisodeStore) -> str:
    """Return the episode that was recorded last, by its time and never by its name.

    Raises:
        NotFoundError: If there is none.
    """
    summaries = store.summaries()
    if not summaries:
        raise NotFoundError("there is no episode yet")
    return summaries[0].id


def find_episodes(store: EpisodeStore, names: list[str]) -> list[EditedEpisode]:
    """Open episodes by name or by file, in the order given."""
    found: list[EditedEpisode] = []
    for name in names:
        path = Path(name)
        if path.suffix == ".mcap" and path.is_file():
            found.append((open_episode(path), read_notes(path)))
        else:
            episode_id = find_id(store, name)
            found.append((open_episode(store.path(episode_id)), store.notes(episode_id)))
    return found
