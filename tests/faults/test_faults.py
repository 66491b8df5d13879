"""Several faults at once, in virtual time; a drive is the same in every run."""

from __future__ import annotations

import random

import pytest

from tests.kit.sizes import crossed

from .scenario import Fault, FaultWorld, Plan, in_fault_world, outcomes
from .table import FAULTS, LIMIT_S, MODES, SEEDS


@crossed(fault=FAULTS, mode=MODES)
def test_a_drive_is_the_same_to_the_last_digit_in_every_run(fault: Fault, mode: str) -> None:
    assert outcomes(fault, mode, range(3)) == outcomes(fault, mode, range(3))


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
def test_the_robot_stands_in_time_whatever_faults_come_together(first: int) -> None:
    async def live(world: FaultWorld) -> None:
        for seed in range(first, first + A_WORLD):
            await world.live_through_many(make_plan(seed))

    in_fault_world(live)
