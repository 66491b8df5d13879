"""A maintained connection ends its tasks, and says why it cannot connect.

For `test_ws.py`, whose real connection is one.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from robot.bodies.remote.reconnecting import ReconnectingConnection
from robot.clock import RealClock


class Standing(ReconnectingConnection):
    """Connects at once, and stays connected."""

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        connected()
        await asyncio.Event().wait()


def is_thread_there(name: str) -> bool:
    return name in {thread.name for thread in threading.enumerate()}


async def hang() -> None:
    await asyncio.Event().wait()


def check_what_hangs_is_followed_by_no_second_and_cancelled_at_the_end() -> None:
    kept = Standing("kept", RealClock())
    hanging = kept._send_one(hang())
    with pytest.raises(TimeoutError):
        hanging.result(0.01)
    with pytest.raises(ConnectionError, match="no more data"):
        kept._send_one(hang())
    other = kept._send_one(hang(), "another topic")
    kept.close()
    kept.close()
    assert hanging.cancelled() and other.cancelled()
    assert not is_thread_there("kept")
    with pytest.raises(ConnectionError, match="is closed"):
        kept._send_one(hang(), "a third")


def check_a_failure_of_any_kind_is_one_of_the_connection() -> None:
    async def fail() -> None:
        raise LookupError("the hub is gone")

    kept = Standing("kept", RealClock())
    with pytest.raises(ConnectionError, match="the hub is gone"):
        kept._send_one(fail()).result(1.0)
    kept.close()


def check_a_connection_that_is_lost_is_made_again_and_one_that_never_was_is_not() -> None:
    made = threading.Semaphore(0)

    class Losing(ReconnectingConnection):
        async def _connect_once(self, connected: Callable[[], None]) -> None:
            connected()
            made.release()
            raise OSError("lost")

    kept = Losing("kept", RealClock())
    assert made.acquire(timeout=10) and made.acquire(timeout=10), "a second time"
    assert kept.trouble == "lost"
    kept.close()

    class Refused(ReconnectingConnection):
        async def _connect_once(self, connected: Callable[[], None]) -> None:
            raise OSError("nobody there")

    with pytest.raises(ConnectionError, match="nobody there"):
        Refused("kept", RealClock())
    assert not is_thread_there("kept")


CASES = (
    check_what_hangs_is_followed_by_no_second_and_cancelled_at_the_end,
    check_a_failure_of_any_kind_is_one_of_the_connection,
    check_a_connection_that_is_lost_is_made_again_and_one_that_never_was_is_not,
)
