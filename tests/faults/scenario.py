"""Causes one fault at a random moment of a drive, in virtual time. One server serves a thousand
drives."""

from __future__ import annotations

import random
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any, TypeVar

from robot.testing import FakeCamera, FakePolicy, LinkConditions, VirtualClock
from robot.types import Mode, Point
from server.clients.client import Client
from server.clients.freshness import NonceLedger
from tests.server.virtual import Pilot, ServedWorld, Socket

_PICTURE = bytes(5000)
"""As many bytes as a JPEG of 160x120; the content does not matter."""
POINTS = {"forward": Point(0.15, 0.4), "left": Point(-0.6, 0.45)}
"""The steering and throttle of each move, for the pilot and for the learner."""
_WATCHED_S = 0.15
"""Time after the end of a fault for which the robot must stand still."""


_T = TypeVar("_T")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of one fault."""

    stood_after_s: float
    reason: str | None


class FaultWorld(ServedWorld):
    """A robot that has learned to drive forward, and the page of its pilot."""

    page: Pilot
    received_s = 0.0
    """The time at which the server last received a message of the pilot."""

    def __init__(self, clock: VirtualClock, *, proportional: bool = False) -> None:
        camera = FakeCamera(clock, pictures=[_PICTURE])
        super().__init__(clock, camera=camera, policy=FakePolicy())
        self.driver.takes_points = proportional
        # Nonces have the same length in every run.
        self.hub.broadcast.nonces = NonceLedger(0.3, random.Random(1).randrange)
        self._receive, self.hub.receive = self.hub.receive, self._note

    def connect(self, path: str, on_message: Callable[[str | bytes], None]) -> Socket:
        """Open a websocket through the link, and forget those that have ended."""
        self._sockets = [socket for socket in self._sockets if not socket.task.done()]
        return super().connect(path, on_message)

    def _note(self, client: Client, text: str) -> None:
        self.received_s = self.clock.now_s()
        self._receive(client, text)

    async def teach(self) -> None:
        """Open the page and teach a few examples."""
        self.page = await self.pilot(sees=True)
        self.page.mode("train")
        self.hold("forward")
        await self.until(lambda: sum(self.loop.state.taught.values()) > 3)

    def hold(self, move: str) -> None:
        """Have the pilot hold a move; if steering is proportional, at a point near the declared
        one."""
        self.page.hold(move, POINTS[move] if self.driver.takes_points else None)

    def drives(self, move: str) -> bool:
        """True while the body's order is this move, or this point."""
        point = POINTS[move] if self.driver.takes_points else None
        return self.driver.now == move and self.driver.point == point

    async def settle(self, seed: int) -> None:
        """Restart the drive, without faults, with the random numbers of `seed`."""
        self.dice.seed(seed)
        self.camera.rate_hz = self.dice.uniform(10.0, 30.0)
        self.camera.age_s = self.dice.uniform(0.0, 0.04)
        self.link.conditions = LinkConditions(delay_s=self.dice.uniform(0.0, 0.02))
        self.page.vanish()
        await self.until(lambda: not self.hub.broadcast.clients)
        self.page = await self.pilot(sees=True)

    async def drive(self, mode: str) -> None:
        """Have the robot drive by itself, or by its pilot in training or autonomous mode."""
        await self.until(lambda: self.hub.lease.owner == self.page.hello["client"])
        self.page.mode("train" if mode == "train" else "autonomous")
        if mode != "autonomous":
            self.hold("left")
        wanted = "forward" if mode == "autonomous" else "left"
        await self.until(lambda: self.drives(wanted), what="the robot drives")
        await self.forward(self.dice.uniform(0.0, 0.2))

    async def live_through(self, fault: Fault, mode: str, seed: int) -> Outcome:
        """Drive, and have a fault begin and end; the robot must stop, and stay stopped.

        Raises:
            AssertionError: If the robot does not stop, or moves again.
        """
        what = f"{fault.name}, {mode}, seed {seed}"
        await self.settle(seed)
        await self.drive(mode)
        fault.begin(self)
        if fault.counts_from is not None:
            counts_from = fault.counts_from
            await self.until(lambda: counts_from(self) or self.stands(), 30.0, what)
        if fault.counts_from_last_message:
            took_s = await self._stands_after_last_message(what)
        else:
            took_s = await self.until(self.stands, 5.0, what)
        await self.until(lambda: self.mode is Mode.STOPPED, 1.0, f"{what}: stopped")
        reason = self.loop.state.decision.stop_reason
        fault.end(self)
        moved_s = self.driver.moved_s
        await self.forward(_WATCHED_S)
        assert self.stands() and self.driver.moved_s == moved_s, f"{what}: the robot moves again"
        assert self.mode is Mode.STOPPED, f"{what}: the robot starts by itself"
        return Outcome(stood_after_s=took_s, reason=reason)

    async def live_through_many(self, plan: Plan) -> None:
        """Drive while several faults begin and end, one after the other.

        Raises:
            AssertionError: If the robot does not stand in time after the last fault began, or moves
                again.
        """
        await self.settle(plan.seed)
        await self.drive(plan.mode)
        for fault, wait_s in plan.faults:  # a link has only one fault at a time: the last one
            await self.forward(wait_s)
            fault.begin(self)
        await self.until(self.stands, 0.5, f"{plan}: stands")
        await self.until(lambda: self.mode is Mode.STOPPED, 0.1, f"{plan}: stopped")
        moved_s = self.driver.moved_s
        for fault, wait_s in plan.faults:
            fault.end(self)
            await self.forward(_WATCHED_S + wait_s)
        assert self.stands() and self.driver.moved_s == moved_s, f"{plan}: the robot moves again"
        assert self.mode is Mode.STOPPED, f"{plan}: the robot starts by itself"

    async def _stands_after_last_message(self, what: str) -> float:
        """Wait until the robot stands; return the time since the last message that it then
        received."""
        received_s = self.received_s

        def stands() -> bool:
            nonlocal received_s
            if self.stands():
                return True
            received_s = self.received_s
            return False

        await self.until(stands, 10.0, what)
        return max(0.0, self.clock.now_s() - received_s)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Faults, each with the time to wait before it begins."""

    mode: str
    seed: int
    faults: tuple[tuple[Fault, float], ...]


Change = Callable[[FaultWorld], None]
Condition = Callable[[FaultWorld], bool]


@dataclass(frozen=True)
class Fault:
    """One fault, the stop reasons that the robot may report, and the end of the fault."""

    name: str
    begin: Change
    reasons: tuple[str, ...]
    end: Change = lambda world: None
    counts_from: Condition | None = None
    """The condition from which on the robot must stand; None means from the fault's beginning."""
    counts_from_last_message: bool = False
    """The time counts from the last message, because some messages may still arrive in time."""
    note: str = ""

    @property
    def title(self) -> str:
        """The fault's name in the docs, which also says when the time begins."""
        return f"{self.name}{self.note}"


def outcomes(fault: Fault, mode: str, seeds: range, *, proportional: bool = False) -> list[Outcome]:
    """Cause the fault once for each seed."""

    async def drives(world: FaultWorld) -> list[Outcome]:
        return [await world.live_through(fault, mode, seed) for seed in seeds]

    return in_fault_world(drives, proportional=proportional)


def in_fault_world(
    scenario: Callable[[FaultWorld], Coroutine[Any, Any, _T]], *, proportional: bool = False
) -> _T:
    """Run a scenario with a taught robot, in virtual time."""
    clock = VirtualClock(100.0)

    async def main() -> _T:
        async with FaultWorld(clock, proportional=proportional) as world:
            await world.teach()
            return await scenario(world)

    return clock.run(main())
