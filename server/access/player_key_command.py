"""Show, replace or remove the video address for players such as VLC, ffmpeg and dashboards."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot.errors import ConfigurationError, told_as
from robot.store.folder import default_root
from server.access.network import is_for_others, own_addresses
from server.access.player_key import PlayerKey
from server.cli.parser import whole


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    add("--data", type=Path, default=default_root(), help=f"the robot's data folder{shown}")
    add("--port", type=whole(1, 65535), default=8000, help=f"port of the robot{shown}")
    add("--tls", action="store_true", help="the robot is served with --tls")
    text = "make a new key: addresses with the old key stop working"
    add("--new", action="store_true", help=text)
    add("--remove", action="store_true", help="delete the key: no player can watch any more")


def run(args: argparse.Namespace) -> int:
    """Print the addresses with the key of the data folder; make a key if there is none."""
    if args.data != default_root() and not args.data.expanduser().is_dir():
        raise ConfigurationError(
            f"there is no data folder {args.data}; choose the robot's folder with --data FOLDER"
        )
    key = PlayerKey(args.data)
    with told_as(ConfigurationError, f"cannot write the player key in {args.data}"):
        if args.remove:
            key.remove()
            print("The player key was removed. Players lose the video within seconds.")
            return 0
        word = key.replace() if args.new or not key.read() else key.read()
    scheme = "https" if args.tls else "http"
    print("Anybody who has one of these addresses can watch the robot, but do nothing else:")
    for host in ["localhost", *filter(is_for_others, own_addresses())]:
        shown = f"[{host}]" if ":" in host else host
        print(f"  {scheme}://{shown}:{args.port}/video.mjpg?key={word}")
    print("Other computers can reach the robot only if it is served with --lan.")
    return 0
