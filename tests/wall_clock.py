"""Keeps tests off the wall clock, except tests with the mark `realtime`.

A test without the mark may not wait through `RealClock` or `time.sleep`, wait with a time limit in
code of this project, read the machine's clock itself, or use sockets.
"""

import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

import pytest

from robot.clock import RealClock

MOST = 37
"""The largest number of marked tests outside tests/e2e, which rises only for a new real part. The
last ones were LeRobot's robot with a served simulator, and a robot on DDS."""
BROWSERS = "e2e/"
"""The tests in this folder run Chromium, so they get the mark automatically, and do not count."""
_OURS = ("robot", "server", "tests")
_ALL_SOCKETS = (socket.AF_INET, socket.AF_INET6)


class TouchedTheWallClockError(AssertionError):
    """A test that is not marked `realtime` waited in real time."""


def is_exempt(file: str, name: str) -> bool:
    """True if a test may use the wall clock without a mark.

    Args:
        file: The test's path below tests/, as in `robot/test_errors.py`.
        name: The test's name, with its parameters.
    """
    if file.startswith(BROWSERS):
        return True
    # Real cameras and bricks, and a simulated camera for a separate process.
    is_real = name.endswith("[v4l2]") and "FAKE_VIDEO" in os.environ
    is_real |= name.endswith("[ev3-remote]") and "DRIVELESSON_EV3" in os.environ
    return file.startswith("contract/") and is_real


def is_marked(item: pytest.Item) -> bool:
    """True if a collected test may use the wall clock."""
    return item.get_closest_marker("realtime") is not None


def hold_to_the_limit(session: pytest.Session, items: list[pytest.Item]) -> None:
    """End the run if too many tests have the mark `realtime`.

    A worker's `shouldfail` is printed; another error would show only the traceback of a broken run.
    """
    by_hand = [item.nodeid for item in items if is_marked(item)]
    if len(by_hand) > MOST:
        session.shouldfail = (
            f"{len(by_hand)} tests are marked `realtime`, and at most {MOST} may be: give one a "
            "VirtualClock (CONTRIBUTING.md) and take its mark away, or make two of them one\n"
            + "\n".join(by_hand)
        )
        raise session.Failed(session.shouldfail)


@pytest.fixture(autouse=True)
def _off_the_wall_clock(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Make the wall clock fail in a test without the mark."""
    if is_marked(request.node):
        yield
        return
    touched: list[str] = []

    def refuse(what: str) -> None:
        touched.append(what)
        raise TouchedTheWallClockError(
            f"{what} touches the wall clock: give the code a VirtualClock (CONTRIBUTING.md), or "
            "mark the test `realtime` if it is about a real part"
        )

    def is_named(frame: FrameType, what: str) -> bool:
        """False for compiled libraries without Python frames, because PyAV reads the clock."""
        return what.rpartition(".")[2] in frame.f_code.co_names

    def refused(original: Callable[..., Any], what: str, callers: tuple[str, ...] = ()) -> Any:
        def stand_in(*args: Any, **options: Any) -> Any:
            frame = sys._getframe(1)
            caller = str(frame.f_globals.get("__name__", ""))
            if not callers or (caller.split(".")[0] in callers and is_named(frame, what)):
                refuse(what)
            return original(*args, **options)

        return stand_in

    for name in ("sleep", "start_thread"):
        monkeypatch.setattr(RealClock, name, refused(getattr(RealClock, name), f"RealClock.{name}"))
    monkeypatch.setattr(time, "sleep", refused(time.sleep, "time.sleep", _OURS))
    for name in ("monotonic", "perf_counter"):
        monkeypatch.setattr(time, name, refused(getattr(time, name), f"time.{name}", ("tests",)))
    wait = threading.Event.wait

    def wait_without_limit(event: threading.Event, timeout: float | None = None) -> bool:
        caller = str(sys._getframe(1).f_globals.get("__name__", ""))
        if timeout and caller.split(".")[0] in _OURS and not event.is_set():
            refuse("a wait with a time limit")
        return wait(event, timeout)

    monkeypatch.setattr(threading.Event, "wait", wait_without_limit)
    connect = socket.socket.connect

    def connect_nowhere(own: socket.socket, address: Any) -> None:
        by = sys._getframe(1).f_code.co_name  # Windows makes a socket pair from a real connection
        if own.family in _ALL_SOCKETS and not by.endswith("socketpair"):
            refuse("a socket")
        connect(own, address)

    monkeypatch.setattr(socket.socket, "connect", connect_nowhere)
    yield
    assert not touched, f"touched the wall clock: {', '.join(sorted(set(touched)))}"
