"""The simulated robots of a class, in the order that keeps a small computer answering."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from server.board.simulated_robot import SimulatedRobot
from server.hosting.serving import open_socket

log = logging.getLogger(__name__)
RATE_HZ, PER_CORE_HZ = 30, 150
"""Pictures a second of a robot at most, and of all of them for each of the computer's cores."""


@contextlib.contextmanager
def simulated_robots(
    count: int, *, host: str, port: int, data: Path, world: str, key: Path
) -> Iterator[list[int]]:
    """Run so many robots inside the block, each with a room of its own; yields their ports.

    Args:
        count: How many.
        host: Where they serve, on the ports behind `port`.
        port: The board's.
        data: Each has a folder in its folder `class`.
        world: Where they drive.
        key: The file of the class's key.
    """
    robots = [SimulatedRobot(i, port + i, data / "class" / f"{i:02d}") for i in range(1, count + 1)]
    for robot in robots:  # before any of them starts: is the port free?
        open_socket(host, robot.port).close()
    cores = os.cpu_count() or 1
    rate_hz = min(RATE_HZ, max(1, PER_CORE_HZ * cores // max(1, count)))
    if rate_hz < RATE_HZ:
        log.warning("%d robots on %d cores: %d pictures a second each", count, cores, rate_hz)
    starting = ThreadPoolExecutor(cores)  # all at once would keep the board from answering
    try:
        for robot in robots:
            starting.submit(robot.start, host, world, key, rate_hz)
        yield [robot.port for robot in robots]
    finally:
        for robot in robots:
            robot.end()
        starting.shutdown(cancel_futures=True)
        for robot in robots:
            robot.end()
        for robot in robots:
            robot.wait()
