"""Waits until a condition holds, by the wall clock or by a virtual clock."""

from __future__ import annotations

from collections.abc import Callable

from robot.clock import Clock, RealClock

_REAL = RealClock()


def wait_until(
    is_so: Callable[[], object], what: str = "", within_s: float = 60.0, clock: Clock = _REAL
) -> float:
    """Wait until a condition holds; return the time that it took, in seconds.

    Args:
        is_so: The condition. The condition is checked again after 5 ms, and in real time less and
            less often, down to every 50 ms, because asking a page or a server costs more than
            waiting.
        what: What the test waits for, as a phrase for the error.
        within_s: The longest time. In real time, this limit only ends a test that hangs, because a
            test must not fail on a busy machine.
        clock: The clock of the wait.

    Raises:
        AssertionError: If the condition does not hold in time.
    """
    started_s, pause_s = clock.now_s(), 0.005
    while not is_so():
        assert clock.now_s() - started_s < within_s, f"not within {within_s} s: {what}"
        clock.sleep(pause_s)
        pause_s = min(1.3 * pause_s, 0.05) if clock is _REAL else pause_s
    return clock.now_s() - started_s
