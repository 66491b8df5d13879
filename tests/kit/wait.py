"""Waits for a condition, by the wall clock or by a virtual clock."""

from __future__ import annotations

from collections.abc import Callable

from robot.clock import Clock, RealClock

_REAL = RealClock()


def wait_until(
    is_so: Callable[[], object], what: str = "", within_s: float = 60.0, clock: Clock = _REAL
) -> float:
    """Wait until a condition holds; return the time that it took, in seconds.

    Args:
        is_so: Asked again every 5 ms.
        what: What is waited for, said if it does not come.
        within_s: A busy machine is no fault: a test in real time names a time only to end one day.
        clock: By which is waited.

    Raises:
        AssertionError: If it does not come in time.
    """
    started_s = clock.now_s()
    while not is_so():
        assert clock.now_s() - started_s < within_s, f"not within {within_s} s: {what}"
        clock.sleep(0.005)
    return clock.now_s() - started_s
