"""A robot in virtual time on an event loop: its camera takes pictures, its control loop ticks."""

from __future__ import annotations

import asyncio
import random
import threading
from collections.abc import Callable
from typing import Self

from robot.control.loop import LoopConfig
from robot.devices.rig import Rig
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.testing.camera import FakeCamera
from robot.testing.driver import FakeDriver
from robot.testing.virtual_clock import VirtualClock


class VirtualRobot:
    """The parts that `Rig.start` would run on threads, here as events of one event loop.

    Use it inside of `VirtualClock.run`, as an async context manager.

    Example:
        >>> async def main() -> int:
        ...     async with VirtualRobot(clock) as world:
        ...         await world.forward(1.0)
        ...         return world.loop.state.frame_id
        >>> clock = VirtualClock()
        >>> clock.run(main())
        30

    Args:
        clock: On which the event loop runs.
        policy: What drives; `published-8` by default.
        config: The loop's limits.
        camera: Takes the pictures; 30 a second by default.
        seed: Of all random numbers.
    """

    def __init__(
        self,
        clock: VirtualClock,
        policy: Policy | None = None,
        config: LoopConfig | None = None,
        camera: FakeCamera | None = None,
        seed: int = 1,
    ) -> None:
        self.clock = clock
        self.dice = random.Random(seed)
        self.driver = FakeDriver(clock=clock)
        self.camera = camera or FakeCamera(clock)
        wake = _Wake(self._tick_soon)
        policy = policy or make_policy("published-8")
        self.rig = Rig(self.driver, self.camera, policy, clock, config, wake)
        self.loop = self.rig.loop
        self._is_tick_due = False
        self._event_loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._tick_by_s = 0.0
        self._shutter: asyncio.TimerHandle | None = None
        self._looks: list[Callable[[], None]] = []

    async def __aenter__(self) -> Self:
        self._event_loop = asyncio.get_running_loop()
        self.driver.connect()
        self._take_picture()
        self._tick_soon()
        return self

    async def __aexit__(self, *error: object) -> None:
        for handle in (self._timer, self._shutter):
            if handle is not None:
                handle.cancel()
        self._event_loop = None
        self.driver.disconnect()

    async def forward(self, seconds: float) -> None:
        await self.clock.pause(seconds)

    async def until(
        self, condition: Callable[[], bool], within_s: float = 10.0, what: str = ""
    ) -> float:
        """Let time pass until a condition holds; return how long it took.

        The condition is looked at after each tick and each `poke`.

        Raises:
            AssertionError: If it does not hold within `within_s`.
        """
        event_loop = asyncio.get_running_loop()
        start_s = event_loop.time()  # `clock` may be made to jump meanwhile
        outcome: asyncio.Future[bool] = event_loop.create_future()

        def look(is_last: bool = False) -> None:
            if outcome.done():
                return
            try:
                if (holds := condition()) or is_last:
                    outcome.set_result(holds)
            except Exception as error:
                outcome.set_exception(error)

        look()
        patience = event_loop.call_later(within_s, look, True)
        self._looks.append(look)
        try:
            in_time = await outcome
        finally:
            patience.cancel()
            self._looks.remove(look)
        assert in_time, f"not within {within_s} s: {what}"
        return event_loop.time() - start_s

    def poke(self) -> None:
        """Make `until` check its condition again: where something happens, and never in vain."""
        for look in self._looks:
            look()

    def _tick_soon(self) -> None:
        if not self._is_tick_due and self._event_loop is not None:
            self._is_tick_due = True
            self._event_loop.call_soon(self._tick)

    def _tick(self) -> None:
        if self._event_loop is None:
            return
        self._is_tick_due = False
        self.loop.wake.clear()
        self.loop.tick(self.clock.now_s())
        self._tick_by_s = self._event_loop.time() + self.loop.wait_s
        if self._timer is not None and self._timer.when() > self._tick_by_s:
            self._timer.cancel()
            self._timer = None
        if self._timer is None:
            self._timer = self._event_loop.call_at(self._tick_by_s, self._tick_if_idle)
        self.poke()

    def _tick_if_idle(self) -> None:
        """Tick after the longest wait; one timer follows the ticks, as most come by pictures."""
        self._timer = None
        if self._event_loop is None:
            return
        if self._event_loop.time() < self._tick_by_s:
            self._timer = self._event_loop.call_at(self._tick_by_s, self._tick_if_idle)
        else:
            self._tick_soon()

    def _take_picture(self) -> None:
        if self._event_loop is None:
            return
        if not self.camera.is_frozen:
            self.camera.take()
        self._shutter = self._event_loop.call_later(1 / self.camera.rate_hz, self._take_picture)


class _Wake(threading.Event):
    """Makes the loop tick as soon as it is woken; all is one thread, so nobody waits for it."""

    def __init__(self, listener: Callable[[], None]) -> None:
        super().__init__()
        self._listener = listener
        self._is_woken = False

    def is_set(self) -> bool:
        return self._is_woken

    def set(self) -> None:
        self._is_woken = True
        self._listener()

    def clear(self) -> None:
        self._is_woken = False
