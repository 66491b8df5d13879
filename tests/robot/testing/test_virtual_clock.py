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
            seen.append(f"{name} {clock.now_s()}")

    workers = [
        clock.start_thread(lambda: beat("slow", 2.0), "slow"),
        clock.start_thread(lambda: beat("fast", 0.75), "fast"),
    ]
    for worker in workers:
        worker.join()
    assert seen == ["fast 0.75", "fast 1.5", "slow 2.0", "fast 2.25", "slow 4.0", "slow 6.0"]
    assert not any(worker.is_alive() for worker in workers)


def test_an_event_and_a_future_end_a_wait_at_the_time_at_which_they_are_set() -> None:
    clock, event, future = VirtualClock(), threading.Event(), Future[int]()

    def set_later() -> None:
        clock.sleep(3.0)
        event.set()
        clock.sleep(1.0)
        future.set_result(7)

    clock.start_thread(set_later, "setter")
    assert clock.wait(event, 60.0)
    assert clock.now_s() == 3.0
    with pytest.raises(TimeoutError):
        clock.result(future, 0.5)
    assert clock.result(future, 10.0) == 7
    assert clock.now_s() == 4.0


def test_a_deadlock_is_an_error_and_not_a_test_that_hangs() -> None:
    with pytest.raises(RuntimeError, match="every thread waits, and none has a deadline"):
        VirtualClock().wait(threading.Event())
    with pytest.raises(RuntimeError, match="every task waits, and none has a deadline"):
        VirtualClock().run(asyncio.Event().wait())


def test_tasks_wait_in_virtual_time_and_in_order_whatever_the_clock_jumps() -> None:
    clock = VirtualClock(100.0)

    async def after(seconds: float) -> float:
        await clock.pause(seconds)
        return clock.now_s()

    async def main() -> list[float]:
        found = list(await asyncio.gather(after(3600.0), after(0.5), after(60.0)))
        clock.advance(1000.0)
        return [*found, await after(1.0)]

    assert clock.run(main()) == pytest.approx([3700.0, 100.5, 160.0, 4701.0])


def test_threads_and_an_event_loop_take_turns() -> None:
    clock, seen, ending = VirtualClock(), [], threading.Event()

    with clock.runner() as runner:
        event_loop, arrived = runner.get_loop(), asyncio.Event()

        def beat() -> None:
            while not clock.wait(ending, 1.0):
                seen.append(f"thread {clock.now_s()}")
                if clock.now_s() == 3.0:
                    event_loop.call_soon_threadsafe(arrived.set)

        async def main() -> None:
            for _ in range(2):
                await clock.pause(0.75)
                seen.append(f"task {clock.now_s()}")
            await arrived.wait()
            seen.append(f"told {clock.now_s()}")

        worker = clock.start_thread(beat, "beat")
        runner.run(main())
        ending.set()
        worker.join()
    assert seen == ["task 0.75", "thread 1.0", "task 1.5", "thread 2.0", "thread 3.0", "told 3.0"]


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


def test_the_clock_moves_to_the_end_of_a_wait_never_back_and_the_wall_clock_may_jump() -> None:
    clock = VirtualClock(5.0)
    assert not clock.wait(threading.Event(), 2.0)
    clock.set_wall(10.0)
    clock.advance(1.0)
    assert (clock.now_s(), clock.wall_s()) == (8.0, 11.0)
    with pytest.raises(ValueError, match="go back"):
        clock.advance(-1.0)
