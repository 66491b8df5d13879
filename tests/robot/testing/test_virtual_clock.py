from __future__ import annotations

import asyncio
import threading
from concurrent.futures import Future

import pytest

from robot.testing import VirtualClock


def test_threads_take_turns_in_the_order_of_their_time() -> None:
    clock, seen = VirtualClock(), []

    def beat(name: str, every_s: float) -> None:
        for _ in range(3):
            clock.sleep(every_s)
            seen.append((name, clock.now_s()))

    workers = [
        clock.start_thread(lambda: beat("slow", 2.0), "slow"),
        clock.start_thread(lambda: beat("fast", 0.75), "fast"),
    ]
    for worker in workers:
        worker.join()
    assert seen == [
        ("fast", 0.75), ("fast", 1.5), ("slow", 2.0), ("fast", 2.25), ("slow", 4.0), ("slow", 6.0),
    ]  # fmt: skip
    assert not any(worker.is_alive() for worker in workers)


def test_an_event_ends_a_wait_at_the_time_at_which_it_is_set() -> None:
    clock, event = VirtualClock(), threading.Event()

    def set_later() -> None:
        clock.sleep(3.0)
        event.set()

    clock.start_thread(set_later, "setter")
    assert clock.wait(event, 60.0)
    assert clock.now_s() == 3.0


def test_a_future_is_waited_for() -> None:
    clock, future = VirtualClock(), Future[int]()

    def answer() -> None:
        clock.sleep(1.0)
        future.set_result(7)

    clock.start_thread(answer, "answering")
    with pytest.raises(TimeoutError):
        clock.result(future, 0.5)
    assert clock.result(future, 10.0) == 7
    assert clock.now_s() == 1.0


def test_a_deadlock_is_an_error_and_not_a_test_that_hangs() -> None:
    clock = VirtualClock()
    with pytest.raises(RuntimeError, match="every thread waits, and none has a deadline"):
        clock.wait(threading.Event())


def test_tasks_wait_in_virtual_time_and_in_order() -> None:
    clock = VirtualClock(100.0)

    async def after(seconds: float) -> float:
        await clock.pause(seconds)
        return clock.now_s()

    async def main() -> list[float]:
        return list(await asyncio.gather(after(3600.0), after(0.5), after(60.0)))

    assert clock.run(main()) == pytest.approx([3700.0, 100.5, 160.0])
    assert clock.now_s() == pytest.approx(3700.0)


def test_a_jump_ahead_does_not_move_the_event_loop() -> None:
    clock = VirtualClock()

    async def main() -> float:
        clock.advance(3600.0)
        await clock.pause(1.0)
        return clock.now_s()

    assert clock.run(main()) == pytest.approx(3601.0)


def test_tasks_that_wait_for_ever_end_with_an_error() -> None:
    async def main() -> None:
        await asyncio.Event().wait()

    with pytest.raises(RuntimeError, match="every task waits, and none has a deadline"):
        VirtualClock().run(main())


def test_threads_and_an_event_loop_take_turns() -> None:
    clock, seen, ending = VirtualClock(), [], threading.Event()

    with clock.runner() as runner:
        event_loop, arrived = runner.get_loop(), asyncio.Event()

        def beat() -> None:
            while not clock.wait(ending, 1.0):
                seen.append(("thread", clock.now_s()))
                if len(seen) == 5:
                    event_loop.call_soon_threadsafe(arrived.set)

        async def main() -> None:
            for _ in range(2):
                await clock.pause(0.75)
                seen.append(("task", clock.now_s()))
            await arrived.wait()
            seen.append(("told", clock.now_s()))

        worker = clock.start_thread(beat, "beat")
        runner.run(main())
        ending.set()
        worker.join()
    assert seen == [
        ("task", 0.75), ("thread", 1.0), ("task", 1.5),
        ("thread", 2.0), ("thread", 3.0), ("told", 3.0),
    ]  # fmt: skip


def test_a_thread_with_a_lock_may_wait_while_another_wants_the_lock() -> None:
    clock, seen = VirtualClock(), []
    lock = clock.lock()

    def work(name: str) -> None:
        with lock, lock:
            clock.sleep(1.0)
            seen.append((name, clock.now_s()))

    workers = [clock.start_thread(lambda name=name: work(name), name) for name in ("one", "two")]
    for worker in workers:
        worker.join()
    assert seen == [("one", 1.0), ("two", 2.0)]


def test_a_clock_of_one_thread_moves_to_the_end_of_a_wait() -> None:
    clock = VirtualClock(5.0)
    assert not clock.wait(threading.Event(), 2.0)
    assert clock.now_s() == 7.0
    with pytest.raises(RuntimeError, match="none has a deadline"):
        clock.wait(threading.Event())
    with pytest.raises(ValueError, match="go back"):
        clock.advance(-1.0)


def test_the_wall_clock_may_jump_and_the_other_does_not() -> None:
    clock = VirtualClock(5.0)
    clock.set_wall(10.0)
    clock.advance(1.0)
    assert (clock.now_s(), clock.wall_s()) == (6.0, 11.0)
