"""Faults in virtual time, alone or together: the robot stops, reports why, and stays stopped.

The same limits must never stop the robot of an ordinary phone.
"""

from __future__ import annotations

import random

import pytest

from robot.testing import LinkConditions
from robot.types import DrivenBy, Mode, StopReason
from tests.kit.sizes import crossed, size

from .scenario import FaultWorld, Plan, in_fault_world, outcomes
from .table import FAULTS, LIMIT_S, MODES, SEEDS

NAMED = {fault.name: fault for fault in FAULTS}


@crossed(name=NAMED, mode=MODES, by=["moves", "degrees"])
def test_the_robot_stops_in_time_at_any_moment_of_a_fault(name: str, mode: str, by: str) -> None:
    fault, is_proportional = NAMED[name], by == "degrees"
    found = outcomes(fault, mode, range(SEEDS), proportional=is_proportional)
    late = {n: one.stood_after_s for n, one in enumerate(found) if one.stood_after_s >= LIMIT_S}
    assert not late, f"the robot does not stop in time, by seed: {late}"
    assert {outcome.reason for outcome in found} <= set(fault.reasons)


def test_a_drive_is_the_same_to_the_last_digit_in_every_run() -> None:
    """If a run fails, its seed must cause the same failure again."""
    fault = NAMED["the camera freezes"]
    one, other = (outcomes(fault, "autonomous", range(3)) for _ in range(2))
    assert one == other and len({outcome.stood_after_s for outcome in one}) == 3


PROMPT = [fault for fault in FAULTS if not fault.counts_from and not fault.counts_from_last_message]
PLANS = max(SEEDS, 50)
A_WORLD = 25
"""Number of plans that share a robot; each plan begins with a restart of the robot."""


def make_plan(seed: int) -> Plan:
    """Draw three faults, and the time at which each begins."""
    dice = random.Random(seed)
    mode = dice.choice(MODES)
    faults = tuple((dice.choice(PROMPT), dice.uniform(0.0, 0.3)) for _ in range(3))
    return Plan(mode=mode, seed=seed, faults=faults)


@pytest.mark.parametrize("first", range(0, PLANS, A_WORLD))
def test_the_robot_stops_in_time_at_any_combination_of_faults(first: int) -> None:
    async def live(world: FaultWorld) -> None:
        for seed in range(first, first + A_WORLD):
            await world.live_through_many(make_plan(seed))

    in_fault_world(live)


DRIVE_S = float(size("DRIVE", 60, 600))
WIFI = LinkConditions(delay_s=0.004, jitter_s=0.03, stall_share=0.01, stall_s=0.06)
"""A delay of some milliseconds each way, other traffic, and one packet in a hundred lost."""
LONGEST_PAUSE_S = 0.2
"""The phone scans for networks or saves power: messages wait for a while, and arrive together."""
GONE = ("the tab is closed", "the browser is killed", "the page hangs, or its tab is suspended",
        "the network falls silent")  # fmt: skip
ENDS = size("ENDS", 2, 10)
"""Number of drives of each kind; at the end of each drive, the pilot disappears."""


async def on_wifi(world: FaultWorld, rate_hz: float, age_s: float, seed: int) -> None:
    """Drive under these conditions until the robot's measurements have settled."""
    await world.settle(seed)
    world.camera.rate_hz, world.camera.age_s = rate_hz, age_s
    world.link.conditions = WIFI
    await world.forward(3.0)


@pytest.mark.parametrize(("rate_hz", "age_s"), [(30.0, 0.005), (10.0, 0.145)])
def test_a_robot_drives_itself_for_ten_minutes_with_an_ordinary_phone(
    rate_hz: float, age_s: float
) -> None:
    stops: list[StopReason] = []

    async def scenario(world: FaultWorld) -> tuple[int, float]:
        # The slower camera is at the limit: with two of ten seeds, one stop occurs in ten minutes.
        await on_wifi(world, rate_hz, age_s, seed=0)
        await world.drive("autonomous")
        moved_s, started_s = world.driver.moved_s, world.clock.now_s()

        def note(tick: object) -> None:
            decision = world.loop.state.decision
            if decision.mode is not Mode.AUTONOMOUS and decision.stop_reason is not None:
                stops.append(decision.stop_reason)

        unsubscribe, pauses = world.loop.subscribe(note), 0
        while world.clock.now_s() < started_s + DRIVE_S:
            await world.forward(world.dice.uniform(0.5, 5.0))
            world.link.conditions = LinkConditions(is_silent=True)
            await world.forward(world.dice.uniform(0.02, LONGEST_PAUSE_S))
            world.link.conditions = WIFI
            pauses += 1
        unsubscribe()
        assert world.loop.state.decision.driven_by is DrivenBy.ROBOT
        return pauses, (world.driver.moved_s - moved_s) / (world.clock.now_s() - started_s)

    pauses, moving = in_fault_world(scenario)
    assert stops == []
    assert pauses > DRIVE_S / 4
    assert moving > 0.99


@pytest.mark.parametrize("mode", MODES)
def test_the_robot_stops_within_half_a_second_after_its_pilot_is_gone(mode: str) -> None:
    async def scenario(world: FaultWorld) -> None:
        for fault in (NAMED[name] for name in GONE):
            for seed in range(ENDS):
                await on_wifi(world, 30.0, 0.005, seed)
                await world.drive(mode)
                await world.forward(world.dice.uniform(0.5, 1.5))
                fault.begin(world)
                await world.until(world.stands, 0.5, fault.name)
                await world.until(lambda: world.mode is Mode.STOPPED, 0.1, "the robot is stopped")
                fault.end(world)

    in_fault_world(scenario)
