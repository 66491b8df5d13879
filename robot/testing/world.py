"""A robot in virtual time on an event loop: its camera takes pictures, its control loop ticks."""

from __future__ import annotations

import asyncio
import random
import threading
from collections.abc import Callable
from typing import Self

from robot.clock import VirtualClock
from robot.control.loop import LoopConfig
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.rig.rig import Rig
from robot.testing.camera import FakeCamera
from robot.testing.driver import FakeDriver


class VirtualRobot:
    """The parts that `Rig.start` would run on threads, here as events of one event loop.

    Use it inside of `VirtualClock.run`, as an async context manager::

        async def main() -> None:
            async with VirtualRobot(clock) as world:
                await world.until(lambda: world.driver.now is Action.STOP)

        clock = VirtualClock()
        clock.run(main())

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
        self._shutter: asyncio.TimerHandle | None = None
        self._happened: asyncio.Future[None] | None = None

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
        """Let time pass."""
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
        patience = event_loop.call_later(within_s, self.poke)
        try:
            while not condition():
                assert event_loop.time() - start_s < within_s, f"not within {within_s} s: {what}"
                self._happened = self._happened or event_loop.create_future()
                await self._happened
        finally:
            patience.cancel()
        return event_loop.time() - start_s

    def poke(self) -> None:
        """Make `until` check its condition again."""
        if self._happened is not None:
            self._happened.set_result(None)
            self._happened = None

    def _tick_soon(self) -> None:
        if not self._is_tick_due and self._event_loop is not None:
            self._is_tick_due = True
            self._event_loop.call_soon(self._tick)

    def _tick(self) -> None:
        if self._event_loop is None:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._is_tick_due = False
        self.loop.wake.clear()
        self.loop.tick(self.clock.now_s())
        self._timer = self._event_loop.call_later(self.loop.config.longest_wait_s, self._tick_soon)
        self.poke()

    def _take_picture(self) -> None:
        if self._event_loop is None:
            return
        if not self.camera.is_frozen:
            self.camera.take()
        self._shutter = self._event_loop.call_later(1 / self.camera.rate_hz, self._take_picture)


class _Wake(threading.Event):
    """Makes the loop tick as soon as it is woken."""

    def __init__(self, listener: Callable[[], None]) -> None:
        super().__init__()
        self._listener = listener

    def set(self) -> None:
        if not self.is_set():
            super().set()
        self._listener()
