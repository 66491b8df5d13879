"""A late computer slows the robot down before it stops it, and the computer is blamed, not the
link."""

from __future__ import annotations

import asyncio

import pytest

from robot.types import Mode, StopReason
from tests.server.virtual import Pilot, ServedWorld, virtually


async def keep_busy(world: ServedWorld, late_s: float, for_s: float) -> list[tuple[bool, float]]:
    """Hold the computer up again and again; return the robot's messages and its speed."""
    said = []
    until_s = world.clock.now_s() + for_s
    while world.clock.now_s() < until_s:
        world.clock._now_s += late_s  # nobody runs, ...
        await asyncio.sleep(1e-6)  # ... and then everything that is due
        await asyncio.sleep(world.dice.uniform(0.1, 0.3))
        state = world.loop.state
        said.append((world.loop.state.link.is_busy, state.decision.speed_scale))
    return said


async def driving(world: ServedWorld) -> Pilot:
    pilot = await world.pilot(sees=True)
    pilot.mode("train")
    await world.until(lambda: world.mode is Mode.TRAIN)
    pilot.hold("forward")
    await world.forward(1.0)
    assert not world.loop.state.link.is_busy
    return pilot


@pytest.mark.parametrize("late_s", [0.0, 0.01, 0.03])
def test_a_computer_that_keeps_time_is_not_reported_as_busy(late_s: float) -> None:
    async def scenario(world: ServedWorld) -> None:
        await driving(world)
        said = await keep_busy(world, late_s, 3.0)
        assert not any(is_busy for is_busy, _ in said)
        assert world.mode is Mode.TRAIN

    virtually(scenario)


def test_a_late_computer_slows_down_before_it_stops_and_recovers() -> None:
    async def scenario(world: ServedWorld) -> None:
        pilot = await driving(world)
        said = await keep_busy(world, 0.15, 5.0)
        assert world.mode is Mode.TRAIN, "it drives on"
        assert (True, 0.5) in said
        assert all(speed == 0.5 for is_busy, speed in said if is_busy)
        await world.forward(3.0)
        assert (world.loop.state.link.is_busy, world.loop.state.decision.speed_scale) == (
            False,
            1.0,
        )
        assert pilot.state["busy"] is False

    virtually(scenario)


def test_the_reason_of_a_stop_is_shown_while_the_robot_stands() -> None:
    async def scenario(world: ServedWorld) -> None:
        pilot = await driving(world)
        await keep_busy(world, 0.6, 2.0)
        await world.forward(20.0)
        decision = world.loop.state.decision
        assert decision.mode is Mode.STOPPED
        if decision.stop_reason is StopReason.LINK_SLOW:
            assert pilot.state["busy"] is True, "it is not the link's fault"

    virtually(scenario)
