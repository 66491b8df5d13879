"""The driver reopens a lost websocket, and the new connection moves nothing."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable

import pytest

from robot.bodies.remote.driver import RemoteOptions
from robot.bodies.remote.reconnecting import ReconnectingConnection
from robot.bodies.remote.ws import WebsocketLine, WsDriver
from robot.clock import RealClock
from robot.errors import DriveError
from robot.types import Action
from tests.contract.real_parts import as_reported, check_real_driver
from tests.robot.bodies.sending import send_until
from tests.standins.ws_robot import WsRobot


@pytest.mark.realtime
def test_a_lost_real_connection_is_opened_again_and_moves_nothing_by_itself() -> None:
    with WsRobot("geheim") as robot:
        driver = WsDriver(RemoteOptions(address=robot.address, secret="geheim"))
        check_real_driver(driver, as_reported(driver, lambda: robot.is_moving))
    check_that_the_driver_reconnects(WsRobot.start_again)
    # Like a power cut at the robot, which closes no connection.
    check_that_the_driver_reconnects(lambda robot: robot.silent.set())
    check_that_the_driver_catches_up_with_late_answers()
    a_hanging_attempt_is_the_only_one_and_is_cancelled_at_the_end()
    any_failure_counts_as_one_of_the_connection()


def check_that_the_driver_reconnects(lose: Callable[[WsRobot], None]) -> None:
    with (
        WsRobot("geheim") as robot,
        WsDriver(RemoteOptions(address=robot.address, secret="geheim")) as driver,
    ):
        send_until(driver, Action.FORWARD, lambda: robot.is_moving)
        lose(robot)
        moved_s = robot.ends_s
        for _ in range(1000):
            try:
                driver.sense()
                if robot.connections > 1:
                    break
            except DriveError as error:
                assert "has not answered" in str(error)
                robot.silent.clear()
            time.sleep(0.01)
        for _ in range(20):
            driver.sense()
        assert robot.connections == 2
        assert robot.ends_s == moved_s, "the driver only asked, and sent no order"
        send_until(driver, Action.LEFT, lambda: robot.is_moving)


def check_that_the_driver_catches_up_with_late_answers() -> None:
    """A driver that read only one answer for each order would never catch up."""
    with WsRobot("geheim") as robot:
        host, _, port = robot.address.partition(":")
        line = WebsocketLine(host, int(port))
        robot.repeats = 5
        line.send(b'{"move": "stop", "seq": 0}\t')
        answers = 0
        for _ in range(30_000):
            answers += line.receive(0.001) is not None
            if answers == 6:
                break
        line.close()
        assert answers == 6


class Standing(ReconnectingConnection):
    """Connects at once, and stays connected."""

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        connected()
        await asyncio.Event().wait()


async def hang() -> None:
    await asyncio.Event().wait()


def a_hanging_attempt_is_the_only_one_and_is_cancelled_at_the_end() -> None:
    kept = Standing("kept", RealClock())
    hanging = kept._send_one(hang())
    with pytest.raises(TimeoutError):
        hanging.result(0.01)
    with pytest.raises(ConnectionError, match="the previous message has not been sent yet"):
        kept._send_one(hang())
    other = kept._send_one(hang(), "another topic")
    kept.close()
    kept.close()
    assert hanging.cancelled() and other.cancelled()
    assert "kept" not in {thread.name for thread in threading.enumerate()}
    with pytest.raises(ConnectionError, match="is closed"):
        kept._send_one(hang(), "a third")


def any_failure_counts_as_one_of_the_connection() -> None:
    async def fail() -> None:
        raise LookupError("the hub is gone")

    kept = Standing("kept", RealClock())
    with pytest.raises(ConnectionError, match="the hub is gone"):
        kept._send_one(fail()).result(1.0)
    kept.close()
