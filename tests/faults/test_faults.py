"""Faults in virtual time, alone or together: the robot stops, reports why, and stays stopped."""

from __future__ import annotations

import random

import pytest

from tests.kit.sizes import crossed

from .scenario import FaultWorld, Plan, in_fault_world, outcomes
from .table import FAULTS, LIMIT_S, MODES, SEEDS

NAMED = {fault.name: fault for fault in FAULTS}


@crossed(name=NAMED, mode=MODES, by=["moves", "degrees"])
def test_the_robot_stops_in_time_at_any_moment_of_a_fault(name: str, mode: str, by: str) -> None:
    found = outcomes(NAMED[name], mode, range(SEEDS), proportional=by == "degrees")
    late = {n: o.stood_after_s for n, o in enumerate(found) if o.stood_after_s >= LIMIT_S[mode]}
    assert not late, f"goes on, by seed: {late}"
    assert {outcome.reason for outcome in found} <= set(NAMED[name].reasons)


@crossed(name=NAMED, mode=MODES)
def test_a_drive_is_the_same_to_the_last_digit_in_every_run(name: str, mode: str) -> None:
    assert outcomes(NAMED[name], mode, range(3)) == outcomes(NAMED[name], mode, range(3))


PROMPT = [fault for fault in FAULTS if not fault.counts_from and not fault.counts_from_last_message]
PLANS = max(SEEDS, 50)
A_WORLD = 25
"""Number of plans that share a robot; each starts it again."""


def make_plan(seed: int) -> Plan:
    """Draw three faults, and the time at which each begins."""
    dice = random.Random(seed)
    mode = dice.choice(MODES)
    faults = tuple((dice.choice(PROMPT), dice.uniform(0.0, 0.3)) for _ in range(3))
    return Plan(mode=mode, seed=seed, limit_s=LIMIT_S[mode], faults=faults)


@pytest.mark.parametrize("first", range(0, PLANS, A_WORLD))
def test_the_robot_stops_in_time_at_any_combination_of_faults(first: int) -> None:
    async def live(world: FaultWorld) -> None:
        for seed in range(first, first + A_WORLD):
            await world.live_through_many(make_plan(seed))

    in_fault_world(live)
