"""Each fault in each mode: the robot stands in time, says why, and never starts again by itself."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import pytest

from robot.types import Mode
from server.bench.proxy import Proxy
from tests.server.live_robot import LiveServer, wait_until

from .table import FAULTS, LIMIT_S, MODES, PAGE, Fault, render, without_figures
from .world import JumpingClock, World, running_world, world_of

MEASURED_MS: dict[tuple[str, str], float] = {}
_SCHEDULING_S = 0.1
"""What a busy machine may add to the limit of one second, which is the loop's own patience."""


@pytest.fixture(scope="module")
def running() -> Iterator[tuple[LiveServer, Proxy, JumpingClock]]:
    with running_world() as parts:
        yield parts


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault(running: tuple[LiveServer, Proxy, JumpingClock], fault: Fault, mode: str) -> None:
    with world_of(*running) as world:
        world.start(mode)
        fault.begin(world)
        counts_from = fault.counts_from
        if counts_from is not None:
            wait_until(lambda: counts_from(world) or world.stands())
        limit_s = LIMIT_S[mode] + (_SCHEDULING_S if mode == "autonomous" else 0.0)
        if fault.counts_from_last_word:
            took_s = _stands_after_last_word(world)
            assert took_s < limit_s, "goes on without the pilot"
        else:
            took_s = wait_until(world.stands, limit_s, f"stands within {limit_s} s")
        MEASURED_MS[fault.name, mode] = 1000 * took_s
        loop = world.server.rig.loop
        wait_until(lambda: loop.state.decision.mode is Mode.STOPPED)
        assert loop.state.decision.stop_reason in fault.reasons
        fault.end(world)
        moved_s = world.server.driver.moved_s
        time.sleep(0.15)
        assert world.stands() and world.server.driver.moved_s == moved_s, "moves by itself"
        assert loop.state.decision.mode is Mode.STOPPED


def _stands_after_last_word(world: World) -> float:
    """Wait until the robot stands; return how long after the last word it then heard."""
    heard_s = world.last_word_s

    def stands() -> bool:
        nonlocal heard_s
        if world.stands():
            return True
        heard_s = world.last_word_s
        return False

    wait_until(stands, 10.0, "stands")
    return max(0.0, time.monotonic() - heard_s)


def test_the_page_of_faults_is_up_to_date() -> None:
    page = render(MEASURED_MS)
    if os.environ.get("DRIVELESSON_WRITE_DOCS"):
        PAGE.write_text(page)
    assert without_figures(PAGE.read_text()) == without_figures(page), (
        "write it anew with DRIVELESSON_WRITE_DOCS=1 pytest tests/faults"
    )
