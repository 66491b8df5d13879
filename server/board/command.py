"""Show all robots of a class on one page: pictures, STOP for all, QR codes, locks, models."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from robot.clock import RealClock
from robot.store.folder import default_root
from server.cli.parser import number, whole

if TYPE_CHECKING:
    from server.board.class_key import ClassKey
    from server.board.transport import RobotAddress

_NETWORK = "network"
BOARD_HOST = "127.0.0.1"
"""The board's address: only browsers on the teacher's computer can reach it."""


def configure(parser: argparse.ArgumentParser) -> None:
    add, shown = parser.add_argument, " (default: %(default)s)"
    text = "HOST:PORT,... or a file with one robot per line (default: all robots in the network)"
    add("--robots", default=_NETWORK, metavar="LIST", help=text)
    text = f"file with the class key, created if missing; each robot needs a copy{shown}"
    file = "class.key"
    add("--class-key", type=Path, default=default_root() / file, metavar="FILE", help=text)
    add("--port", type=whole(0, 65535), default=8080, help=f"port to serve on{shown}")
    text, hz = f"number of pictures a second from each robot{shown}", number(above=0, most=10)
    add("--pictures", type=hz, default=1.0, metavar="HZ", help=text)
    add("-v", "--verbose", action="store_true", help="log more")


def run(args: argparse.Namespace) -> int:
    """Serve the board until interrupted."""
    from server.board.class_key import keep_class_key
    from server.board.discovery import read_list
    from server.hosting.logs import start_logging
    from server.hosting.serving import open_socket

    start_logging(verbose=args.verbose)
    listed = [] if args.robots == _NETWORK else read_list(args.robots)
    listener = open_socket(BOARD_HOST, args.port)
    key = keep_class_key(args.class_key)
    print(f"Copy the class key to each robot: {args.class_key.resolve()}", flush=True)
    print(f"Start each robot with: --lan --class-key {args.class_key.name}", flush=True)
    with listener:
        serve_board(key, listener, listed, 1 / args.pictures)
    return 0


def serve_board(
    key: ClassKey,
    listener: socket.socket,
    listed: Sequence[RobotAddress],
    picture_every_s: float = 1.0,
    lesson: str = "",
    host: str = "0.0.0.0",
) -> None:
    """Serve the board until interrupted.

    Args:
        key: The class key.
        listener: The open socket of the board. The caller opens it, so that a port in use is
            reported before any robot starts.
        listed: The robots; if empty, all robots that the network announces.
        picture_every_s: The time between two pictures of a robot, in seconds.
        lesson: The lesson that the lessons' page opens; if empty, the first lesson.
        host: The address on which the robots of this computer serve.
    """
    from server.access.config import NetworkConfig
    from server.access.network import lan_addresses
    from server.board.app import create_board_app
    from server.board.board import Board
    from server.board.discovery import browsing
    from server.board.transport import NetworkTransport
    from server.config import Config
    from server.hosting.serving import serve

    config = Config(host=BOARD_HOST, port=listener.getsockname()[1])
    clock = RealClock()
    board = Board(key, NetworkTransport(), clock, picture_every_s)
    with contextlib.ExitStack() as stack:

        def begin() -> None:
            own = NetworkConfig(host=host, lan=True)
            board.follow_own_address(lambda: next(iter(lan_addresses(own)), None))
            for address in listed:
                board.add(address)
            if not listed:
                event_loop = asyncio.get_running_loop()

                def found(address: RobotAddress) -> None:  # runs on the thread that listens
                    with contextlib.suppress(RuntimeError):  # the board's event loop has just ended
                        event_loop.call_soon_threadsafe(board.announce, address)

                stack.enter_context(browsing(found))

        page = f"http://{config.host}:{config.port}"
        print(f"The board is ready: open {page}", flush=True)
        print(f"To print the robots' codes, open {page}/codes", flush=True)
        opened = f"#{lesson}" if lesson else ""
        print(f"To project the lessons, open {page}/lesson{opened}", flush=True)
        serve(create_board_app(config, board, clock, begin, lesson), [listener])
