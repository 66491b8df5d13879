from __future__ import annotations

import threading

import pytest

from robot.testing import VirtualClock


def test_a_clock_of_one_thread_moves_to_the_end_of_a_wait() -> None:
    clock = VirtualClock(5.0)
    assert not clock.wait(threading.Event(), 2.0)
    assert clock.now_s() == 7.0
    with pytest.raises(RuntimeError, match="without end"):
        clock.wait(threading.Event())
    with pytest.raises(ValueError, match="go back"):
        clock.advance(-1.0)


def test_the_wall_clock_may_jump_and_the_other_does_not() -> None:
    clock = VirtualClock(5.0)
    clock.set_wall(10.0)
    clock.advance(1.0)
    assert (clock.now_s(), clock.wall_s()) == (6.0, 11.0)
