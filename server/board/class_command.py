"""Run simulated robots for a school class, or give an order to all robots of a running class."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError
from robot.store.folder import default_root
from server.cli.parser import whole

MOST = 60
PORT = 8080
"""The default port of the board."""
ORDERS = ("keep", "reset", "hand-over", "undo")
"""The orders to all robots at the end of a lesson."""
LESSONS = {"teach-it": "box", "fool-it": "box", "fair-data": "box"}
"""The lessons in `docs/lessons`, each with the world in which its simulated robots begin."""


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    text = "order for all robots of the board that runs on this computer (at --port). keep: save a "
    text += "dated copy of each model; reset: save each model and begin an empty one; hand-over: "
    text += "reset, and sign out the phones; undo: undo the last order (default: start a class)"
    add("order", nargs="?", choices=ORDERS, metavar="ORDER", help=text)
    text = "number of simulated robots; or HOST:PORT of real robots, or a file with one per line; "
    text += f"or both, separated by commas{shown}"
    add("--robots", default="10", metavar="LIST", help=text)
    add("--world", help="world of the simulated robots (default: the lesson's world, or box)")
    text = "the first lesson; for fair-data, the robots have already learned left turns only"
    add("--lesson", choices=tuple(LESSONS), help=text)
    text = "address for the pupils; 127.0.0.1: only this computer (default: all its addresses)"
    add("--host", default="0.0.0.0", help=text)
    text = f"the board's port; the robots use the next ports{shown}"
    add("--port", type=whole(1024, 65535 - MOST), default=PORT, help=text)
    text = f"folder for the class key and for each robot's data{shown}"
    add("--data", type=Path, default=default_root(), help=text)
    add("-v", "--verbose", action="store_true", help="log more")


def run(args: argparse.Namespace) -> int:
    """Run the robots and the teacher's board until interrupted. With `args.order`, only send the
    order to a board that already runs."""
    if args.order:
        from server.board.class_orders import give_order

        is_done, lines = give_order(args.order, args.port)
        print("\n".join(lines))
        return 0 if is_done else 1
    from robot.simulator.world import load_world
    from server.access.network import EVERYWHERE
    from server.board.class_key import keep_class_key
    from server.board.command import BOARD_HOST, serve_board
    from server.board.discovery import read_list
    from server.board.ready_lesson import left_turns, locale_of_computer, name_of_left_turns
    from server.board.simulated_robot import simulated_robots
    from server.board.transport import HERE, RobotAddress
    from server.hosting.logs import start_logging
    from server.hosting.serving import open_socket

    start_logging(verbose=args.verbose)
    world = args.world or LESSONS.get(args.lesson, "box")
    load_world(world)
    count, others = split(args.robots)
    listed = read_list(others) if others else []
    listener = open_socket(BOARD_HOST, args.port)
    file = args.data / "class.key"
    key = keep_class_key(file)
    here = HERE if args.host in EVERYWHERE else args.host

    def make_model() -> tuple[str, bytes]:
        print("Making the model with left turns only ...", flush=True)
        return name_of_left_turns(locale_of_computer(os.environ)), left_turns(world)

    place: dict[str, Any] = {"host": args.host, "port": args.port, "data": args.data}
    place["make_model"] = make_model if args.lesson == "fair-data" else None
    with listener, simulated_robots(count, **place, world=world, key=file) as ports:
        listed = [*(RobotAddress(here, port) for port in ports), *listed]
        serve_board(key, listener, listed, lesson=args.lesson or "", host=args.host)
    return 0


def split(text: str) -> tuple[int, str]:
    """Split the value of --robots into the number of simulated robots and the other entries."""
    words = list(filter(None, map(str.strip, text.split(","))))
    count = sum(int(word) for word in words if word.isdecimal())
    listed = [word for word in words if not word.isdecimal()]
    for word in listed:
        if not (":" in word or "." in word or Path(word).is_file()):
            raise ConfigurationError(
                f"--robots {text}: {word!r} is neither a number of simulated robots, nor HOST:PORT "
                "of a real one, nor a file with one HOST:PORT per line"
            )
    others = ",".join(listed)
    if count > MOST or not (count or others):
        raise ConfigurationError(
            f"--robots {text}: give at least one robot, and at most {MOST} simulated ones"
        )
    return count, others
