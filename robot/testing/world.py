"""A robot in virtual time, together with an event loop. The robot's camera takes pictures and its
control loop ticks."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import Self

from robot.control.config import LoopConfig
from robot.control.state import Tick
from robot.devices.rig import Rig
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.testing.camera import FakeCamera
from robot.testing.driver import FakeDriver
from robot.testing.virtual_clock import VirtualClock


class VirtualRobot:
    """A rig (`robot/devices/rig.py`) whose threads take turns with the tasks of an event loop.

    Use it as an async context manager within `VirtualClock.run`.

    Example:
        >>> async def main() -> int:
        ...     async with VirtualRobot(clock) as world:
        ...         await world.forward(1.02)
        ...         return world.loop.state.frame_id
        >>> clock = VirtualClock()
        >>> clock.run(main())
        31

    Args:
        clock: The clock on which the event loop runs.
        policy: The policy that drives; `published-8` by default.
        config: The loop's limits.
        camera: Takes the pictures; 30 a second by default.
        seed: Seed of all random numbers.
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
        policy = policy or make_policy("published-8")
        self.rig = Rig(self.driver, self.camera, policy, clock, config)
        self.loop = self.rig.loop
        self._poked = asyncio.Event()

    async def __aenter__(self) -> Self:
        event_loop = asyncio.get_running_loop()

        def on_tick(tick: Tick) -> None:
            event_loop.call_soon_threadsafe(self.poke)

        self.loop.subscribe(on_tick)
        self.rig.start()
        return self

    async def __aexit__(self, *error: object) -> None:
        self.rig.stop()

    async def forward(self, seconds: float) -> None:
        await self.clock.pause(seconds)

    async def until(
        self, condition: Callable[[], bool], within_s: float = 10.0, what: str = ""
    ) -> float:
        """Let time pass until a condition holds; return the time passed.

        The condition is checked after each tick, and after each call of `poke`.

        Raises:
            AssertionError: If the condition does not hold within `within_s`.
        """
        # the event loop's time, because a test may make `clock` jump during the wait
        start_s = asyncio.get_running_loop().time()
        try:
            async with asyncio.timeout(within_s):
                while not condition():
                    self._poked.clear()
                    await self._poked.wait()
        except TimeoutError:
            assert condition(), f"not within {within_s} s: {what}"
        return asyncio.get_running_loop().time() - start_s

    def poke(self) -> None:
        """Make `until` check its condition again. Call this whenever the condition may change."""
        self._poked.set()
