"""An ordinary phone never trips the robot, and a phone that is gone always stops it.

The limits must meet both figures at once, in virtual time over the same Wi-Fi.
"""

from __future__ import annotations

import pytest

from robot.testing import LinkConditions
from robot.types import DrivenBy, Mode, StopReason
from tests.kit.sizes import size

from .scenario import FaultWorld, in_fault_world
from .table import FAULTS, MODES

DRIVE_S = float(size("DRIVE", 120, 600))
WIFI = LinkConditions(delay_s=0.004, jitter_s=0.03, stall_share=0.01, stall_s=0.06)
"""A delay of some milliseconds each way, other traffic, and one packet in a hundred sent again."""
LONGEST_PAUSE_S = 0.2
"""A phone scans for networks or saves power: nothing passes for a while, then everything at
once."""
CAMERAS = {"33 ms / 5 ms": (30.0, 0.005), "100 ms / 145 ms": (10.0, 0.145)}
GONE = ("the tab is closed", "the browser is killed", "the page hangs, or its tab is suspended",
        "the network falls silent")  # fmt: skip
ENDS = size("ENDS", 3, 10)
"""Number of drives of each kind that end with the pilot gone."""


async def on_wifi(world: FaultWorld, camera: str, seed: int) -> None:
    """Set the conditions of an ordinary drive; at its end the robot's measurements have settled."""
    await world.settle(seed)
    world.camera.rate_hz, world.camera.age_s = CAMERAS[camera]
    world.link.conditions = WIFI
    await world.forward(3.0)


async def live_with_pauses(world: FaultWorld, seconds: float) -> int:
    """Let time pass in which the Wi-Fi pauses occasionally; return the number of pauses."""
    ends_s, pauses = world.clock.now_s() + seconds, 0
    while world.clock.now_s() < ends_s:
        await world.forward(world.dice.uniform(0.5, 5.0))
        world.link.conditions = LinkConditions(is_silent=True)
        await world.forward(world.dice.uniform(0.02, LONGEST_PAUSE_S))
        world.link.conditions = WIFI
        pauses += 1
    return pauses


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_robot_drives_itself_for_ten_minutes_with_an_ordinary_phone(camera: str) -> None:
    stops: list[StopReason] = []

    async def scenario(world: FaultWorld) -> tuple[int, float]:
        # The slower camera is at the limit: with two of ten seeds the robot stops once in the ten
        # minutes.
        await on_wifi(world, camera, seed=0)
        await world.drive("autonomous")
        moved_s, started_s = world.driver.moved_s, world.clock.now_s()

        def note(tick: object) -> None:
            decision = world.loop.state.decision
            if decision.mode is not Mode.AUTONOMOUS and decision.stop_reason is not None:
                stops.append(decision.stop_reason)

        unsubscribe = world.loop.subscribe(note)
        pauses = await live_with_pauses(world, DRIVE_S)
        unsubscribe()
        took_s = world.clock.now_s() - started_s
        assert world.loop.state.decision.driven_by is DrivenBy.ROBOT
        return pauses, (world.driver.moved_s - moved_s) / took_s

    pauses, moving = in_fault_world(scenario)
    assert stops == []
    assert pauses > DRIVE_S / 4
    assert moving > 0.99


@pytest.mark.parametrize("mode", MODES)
def test_the_robot_stops_within_half_a_second_after_its_pilot_is_gone(mode: str) -> None:
    gone = [fault for fault in FAULTS if fault.name in GONE]
    assert len(gone) == len(GONE)

    async def scenario(world: FaultWorld) -> None:
        for fault in gone:
            for seed in range(ENDS):
                await on_wifi(world, "33 ms / 5 ms", seed)
                await world.drive(mode)
                await world.forward(world.dice.uniform(0.5, 1.5))
                fault.begin(world)
                await world.until(world.stands, 0.5, fault.name)
                await world.until(lambda: world.mode is Mode.STOPPED, 0.1, "stopped")
                fault.end(world)

    in_fault_world(scenario)
