"""Run a class on this computer: simulated robots, the board, and a page of codes to print."""

from __future__ import annotations

import argparse
import contextlib
import logging
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from robot.errors import ConfigurationError
from robot.store.folder import default_root
from server.cli.parser import whole

log = logging.getLogger(__name__)
MOST = 60
RATE_HZ, PER_CORE_HZ = 30, 150
"""Pictures a second of a robot at most, and of all of them for each of the computer's cores."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--robots",
        default="10",
        metavar="LIST",
        help="how many simulated ones; HOST:PORT of real ones, or a file of such lines; or both, "
        "with commas in between (default: %(default)s)",
    )
    parser.add_argument(
        "--world", default="box", help="where the simulated ones drive (default: %(default)s)"
    )
    parser.add_argument(
        "--host",
        default="0.0.0.0",
        help="address for the pupils; 127.0.0.1: for this computer alone (default: all it has)",
    )
    parser.add_argument(
        "--port",
        type=whole(1024, 65535 - MOST),
        default=8080,
        help="the board's port; the robots have those that follow (default: %(default)s)",
    )
    parser.add_argument(
        "--data",
        type=Path,
        default=default_root(),
        help="folder for the class's key, and for what each robot keeps (default: %(default)s)",
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="log more")


def run(args: argparse.Namespace) -> int:
    """Run until interrupted; then no process is left."""
    from server.board.class_key import keep_class_key
    from server.board.command import serve_board
    from server.board.discovery import read_list
    from server.board.transport import RobotAddress
    from server.config import Config
    from server.hosting.logs import start_logging
    from server.hosting.network import lan_addresses

    start_logging(verbose=args.verbose)
    count, others = split(args.robots)
    listed = read_list(others) if others else []
    file = args.data / "class.key"
    key = keep_class_key(file)
    # Phones read this address in the codes, so the board uses it, too.
    here = next(iter(lan_addresses(Config(host=args.host, lan=True))), "127.0.0.1")
    with _simulated(count, args, file) as ports:
        serve_board(key, args.port, [*(RobotAddress(here, port) for port in ports), *listed])
    return 0


def split(text: str) -> tuple[int, str]:
    """Return how many simulated robots a list asks for, and the rest of it.

    Raises:
        ConfigurationError: If they are too many, or there are none at all.
    """
    words = list(filter(None, map(str.strip, text.split(","))))
    count = sum(int(word) for word in words if word.isdecimal())
    others = ",".join(word for word in words if not word.isdecimal())
    if count > MOST or not (count or others):
        raise ConfigurationError(
            f"--robots {text}: a class has at least one robot, and at most {MOST} simulated ones"
        )
    return count, others


@contextlib.contextmanager
def _simulated(count: int, args: argparse.Namespace, key: Path) -> Iterator[list[int]]:
    """Run so many robots inside the block, each with a room of its own; yields their ports."""
    from server.board.simulated_robot import SimulatedRobot
    from server.hosting.serving import open_socket

    robots = [
        SimulatedRobot(i, args.port + i, args.data / "class" / f"{i:02d}")
        for i in range(1, count + 1)
    ]
    for robot in robots:  # before any of them starts: is the port free?
        open_socket(args.host, robot.port).close()
    cores = os.cpu_count() or 1
    rate_hz = min(RATE_HZ, max(1, PER_CORE_HZ * cores // max(1, count)))
    if rate_hz < RATE_HZ:
        log.warning("%d robots on %d cores: %d pictures a second each", count, cores, rate_hz)
    starting = ThreadPoolExecutor(cores)  # all at once would keep the board from answering
    try:
        for robot in robots:
            starting.submit(robot.start, args.host, args.world, key, rate_hz)
        yield [robot.port for robot in robots]
    finally:
        for robot in robots:
            robot.end()
        starting.shutdown(cancel_futures=True)
        for robot in robots:
            robot.end()
        for robot in robots:
            robot.wait()
