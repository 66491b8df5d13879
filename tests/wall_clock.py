"""Keeps tests off the wall clock: whoever really needs it is marked `realtime`.

Refused are, in a test without the mark, all waits through `RealClock`, `time.sleep` and waits with
a time limit in code of this project, its tests' own looks at the machine's clock, and sockets.
"""

from __future__ import annotations

import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robot.clock import RealClock

MOST = 38
"""So many tests outside tests/e2e are marked by hand; may only become fewer (asked: 30)."""
REAL_PARTS = (
    "e2e/",
    "brick/test_calibrate.py",
    "brick/test_doctor.py",
    "brick/test_ev3_dc.py",
    "brick/test_installer.py",
    "brick/test_safety.py",
    "brick/test_server_on_brick.py",
    "brick/test_slow_camera.py",
    "brick/test_stock.py",
    "brick/test_v4l2.py",
    "faults/test_bodies.py",
    "robot/drivers/pybricks/",
    "robot/drivers/ros/",
    "robot/drivers/lego_education/",
    "robot/drivers/gpio/test_keeper.py",
)
"""What runs real parts throughout: browsers, agents and fake bricks in processes of their own."""
YET_TO_MOVE = (
    "robot/cameras/test_mjpeg.py",
    "robot/drivers/remote/",
    "server/test_eye.py",
)
"""What still waits for real and need not; may only become less."""
CONTRACTS_YET_TO_MOVE = (
    "lego-education",
    "ev3-stock",
    "mjpeg",
    "pybricks",
    "ros",
    "udp",
    "v4l2",
    "ws",
)
"""Drivers and cameras whose contract is kept over real sockets; may only become fewer."""
_OURS = ("robot", "server", "tests")
_ALL_SOCKETS = (socket.AF_INET, socket.AF_INET6)


class TouchedTheWallClockError(AssertionError):
    """A test that is not marked `realtime` waited for real."""


def is_exempt(file: str, name: str) -> bool:
    """True for a test that may touch the wall clock without a mark.

    Args:
        file: Below tests/, as in `robot/test_clock.py`.
        name: Of the test, with its parameters.
    """
    if file.startswith(REAL_PARTS + YET_TO_MOVE):
        return True
    cases = tuple(f"[{case}]" for case in CONTRACTS_YET_TO_MOVE)
    return file.startswith("contract/") and name.endswith(cases)


def is_marked(item: pytest.Item) -> bool:
    """True for a test that may touch the wall clock."""
    return item.get_closest_marker("realtime") is not None


@pytest.fixture(autouse=True)
def _off_the_wall_clock(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Refuse the wall clock to a test without the mark."""
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

    def refused(original: Callable[..., Any], what: str, callers: tuple[str, ...] = ()) -> Any:
        def stand_in(*args: Any, **options: Any) -> Any:
            caller = str(sys._getframe(1).f_globals.get("__name__", ""))
            if not callers or caller.split(".")[0] in callers:
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
        if own.family in _ALL_SOCKETS:
            refuse("a socket")
        connect(own, address)

    monkeypatch.setattr(socket.socket, "connect", connect_nowhere)
    yield
    assert not touched, f"touched the wall clock: {', '.join(sorted(set(touched)))}"
