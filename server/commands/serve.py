"""Drive a robot from the browser."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError
from robot.options import Option, options_of
from robot.plugins import camera_names, driver_names, load_camera, load_driver

_CAMERA_HELP = "where pictures come from; as a rule the robot's own"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options that every robot has."""
    _add_choice_of_robot(parser)
    parser.add_argument("--learner", default="default", help="what learns (default: %(default)s)")
    parser.add_argument(
        "--max-nodes", default="32", metavar="N", help="images it remembers (default: %(default)s)"
    )
    parser.add_argument("--host", default=None, help="address to serve on (default: 127.0.0.1)")
    parser.add_argument("--port", type=int, default=8000, help="port (default: %(default)s)")
    parser.add_argument(
        "--lan", action="store_true", help="let paired browsers of the local network in"
    )
    parser.add_argument("--data", type=Path, default=None, help="folder for what is kept")
    parser.add_argument("-v", "--verbose", action="store_true", help="log more")


def extend(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Declare the options of the chosen robot and camera as well."""
    first = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    _add_choice_of_robot(first)
    chosen, _ = first.parse_known_args(list(words))
    driver_type = load_driver(chosen.robot)
    camera_type = load_camera(chosen.camera or driver_type.default_camera)
    declared: set[str] = set()
    for title, kind in ((f"robot {chosen.robot}", driver_type), ("camera", camera_type)):
        group = parser.add_argument_group(f"options of the {title}")
        for option in options_of(kind.options_type):
            if option.name not in declared:
                declared.add(option.name)
                _declare(group, option)


def run(args: argparse.Namespace) -> int:
    """Serve until interrupted."""
    from robot.rig import build_rig
    from server.app import create_app
    from server.config import Config
    from server.serving import open_socket, serve

    logging.basicConfig(
        level=logging.DEBUG if args.verbose else logging.INFO,
        format="%(asctime)s %(levelname)s %(name)s %(message)s",
    )
    host = args.host or ("0.0.0.0" if args.lan else "127.0.0.1")
    config = Config(host=host, port=args.port, lan=args.lan, data=args.data)
    learner = f"{args.learner}-{args.max_nodes}"
    rig = build_rig(args.robot, camera=args.camera, learner=learner, options=vars(args))
    listener = open_socket(config.host, config.port)
    app = create_app(config, rig, name=args.robot)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    with rig:
        print(f"Drivelesson: open http://{config.host}:{listener.getsockname()[1]}", flush=True)
        serve(app, config, listener)
    return 0


def _add_choice_of_robot(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--robot", default="sim", help=f"one of {', '.join(driver_names())} (default: %(default)s)"
    )
    parser.add_argument(
        "--camera", default=None, help=f"{_CAMERA_HELP}; one of {', '.join(camera_names())}"
    )


def _declare(group: Any, option: Option) -> None:
    """Turn a declared option into a flag. Values stay text: the rig parses and checks them."""
    shown = "" if option.default is None else f" (default: {option.default})"
    choices = "" if option.choices is None else f": {', '.join(option.choices)}"
    try:
        group.add_argument(
            option.flag, dest=option.name, default=None, help=f"{option.help}{choices}{shown}"
        )
    except argparse.ArgumentError as error:
        raise ConfigurationError(
            f"the option {option.flag} is declared twice; the robot or camera must rename it"
        ) from error
