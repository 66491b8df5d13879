"""The command `drivelesson episodes play`: shows a recording on the page, as if it were a robot."""

from __future__ import annotations

import argparse

from robot.recordings.store import EpisodeStore
from robot.store.folder import Storage
from server.recordings.selection import EPISODE_HELP, EpisodeVerb, find_path


def configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("episode", metavar="EPISODE", help=EPISODE_HELP)
    parser.add_argument("--port", default="8000", help="port to serve on (default: %(default)s)")


def play(args: argparse.Namespace, store: EpisodeStore, storage: Storage) -> int:
    from server.cli.main import main  # imported here, because `main` imports this module

    path = str(find_path(store, args.episode))
    words = ["serve", "--robot", "replay", "--episode", path, "--port", args.port]
    return main([*words, "--data", str(storage.root)])


PLAY = EpisodeVerb("replay a recording on the page, as if it were a robot", configure, play)
