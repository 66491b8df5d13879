"""The worker with an event loop ends what it runs, and says why it cannot connect.

For `test_ws.py`, whose real line has such a worker.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from robot.bodies.remote.event_loop import EventLoopThread
from robot.clock import RealClock


def check_what_hangs_is_cancelled_in_time_and_at_the_end() -> None:
    worker = EventLoopThread("worker", RealClock())
    with pytest.raises(TimeoutError):
        worker.run(asyncio.Event().wait(), 0.01)
    hanging = worker.submit(asyncio.Event().wait())
    worker.close()
    worker.close()
    assert hanging.cancelled()
    assert "worker" not in {thread.name for thread in threading.enumerate()}
    with pytest.raises(ConnectionError, match="is closed"):
        worker.submit(asyncio.Event().wait())


def check_a_failure_of_any_kind_is_one_of_the_connection() -> None:
    async def fail() -> None:
        raise LookupError("the hub is gone")

    worker = EventLoopThread("worker", RealClock())
    with pytest.raises(ConnectionError, match="the hub is gone"):
        worker.run(fail(), 1.0)
    worker.close()


def check_a_connection_that_is_lost_is_made_again_and_one_that_never_was_is_not() -> None:
    made = threading.Semaphore(0)

    async def connect(connected: Callable[[], None]) -> None:
        connected()
        made.release()
        raise OSError("lost")

    worker = EventLoopThread("worker", RealClock())
    worker.keep(connect)
    assert made.acquire(timeout=10) and made.acquire(timeout=10), "a second time"
    assert worker.trouble == "lost"
    worker.close()

    async def refuse(_: Callable[[], None]) -> None:
        raise OSError("nobody there")

    worker = EventLoopThread("worker", RealClock())
    with pytest.raises(ConnectionError, match="nobody there"):
        worker.keep(refuse)
    assert "worker" not in {thread.name for thread in threading.enumerate()}


CASES = (
    check_what_hangs_is_cancelled_in_time_and_at_the_end,
    check_a_failure_of_any_kind_is_one_of_the_connection,
    check_a_connection_that_is_lost_is_made_again_and_one_that_never_was_is_not,
)
