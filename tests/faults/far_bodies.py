"""The server of a remote robot is killed or frozen: the body's last command ends by itself.

The contract of drivers checks how soon: no move lasts longer than its time limit.
"""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.kit.sizes import IS_FULL
from tests.robot.bodies.ev3.own_server import own_server
from tests.server.live_robot import Pilot
from tests.standins.ev3_stock import StockBrick
from tests.standins.mjpeg import MjpegServer
from tests.standins.ws_robot import WsRobot


@dataclass(frozen=True)
class Body:
    """How to serve it, and when its last move ends, in seconds of time.monotonic."""

    options: list[str]
    ends_s: Callable[[], float]


@contextlib.contextmanager
def ev3_stock() -> Iterator[Body]:
    with StockBrick() as brick:
        options = ["ev3-stock", "--line", "wifi", "--beacon-port", str(brick.beacon_port)]
        yield Body(options, lambda: max(m.ends_s if m.percent else 0.0 for m in brick.motors))


@contextlib.contextmanager
def ws() -> Iterator[Body]:
    with WsRobot("s") as robot:
        yield Body(["ws", "--address", robot.address, "--secret", "s"], lambda: robot.ends_s)


def check_that_it_stands(robot: Body) -> None:
    time.sleep(1.0)  # every message in transit has arrived
    for _ in range(1000):
        if robot.ends_s() < time.monotonic():
            break
        time.sleep(0.01)
    stands_s = robot.ends_s()
    assert stands_s < time.monotonic(), "it goes on"
    time.sleep(1.0)
    assert robot.ends_s() == stands_s, "it was told to move again"


def check_a_body_stands_when_its_server_does_not_go_on(folder: Path) -> None:
    for body in (ws, ev3_stock) if IS_FULL else (ws,):
        its_server_is_frozen_and_killed(body, folder / body.__name__)


def its_server_is_frozen_and_killed(
    body: Callable[[], contextlib.AbstractContextManager[Body]], data: Path
) -> None:
    with MjpegServer() as camera, body() as robot:
        options = ["--data", str(data), "--camera", "mjpeg", "--source", camera.address]
        with (
            own_server(*options, "--robot", *robot.options) as (process, address),
            Pilot(address + "/ws/drive") as pilot,
        ):
            for how in (signal.SIGSTOP, signal.SIGKILL):
                pilot.drive_until(lambda: robot.ends_s() > time.monotonic())
                process.send_signal(how)
                check_that_it_stands(robot)
                process.send_signal(signal.SIGCONT)
