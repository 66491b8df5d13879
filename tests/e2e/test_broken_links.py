"""Whatever happens to the page while it drives, the robot stops; tests/faults checks how soon."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import pytest

from robot.types import Mode, StopReason
from tests.kit.wait import wait_until

from .broken_way import BrokenWay
from .hand import Fingers, choose, hold_until, turning, wait_until_standing
from .world import PHONE, World, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture
def proxy(world: World) -> Iterator[BrokenWay]:
    running = BrokenWay(int(world.address.rsplit(":", 1)[1]))
    yield running
    running.close()


def drive(page: Any, world: World) -> Fingers:
    """Have a finger turn the robot."""
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    hold_until(world, fingers, "left", turning(world))
    return fingers


def test_the_robot_stops_if_the_pages_main_thread_hangs(phone: Any, world: World) -> None:
    # A computer that is paused meanwhile stops the robot because of a picture's age.
    for _ in range(5):
        drive(phone, world)
        debugger = phone.context.new_cdp_session(phone)
        debugger.send("Debugger.enable")
        debugger.send("Debugger.pause")  # at the next line that it runs, which is near a heartbeat
        wait_until_standing(world)
        reason = world.rig.loop.state.decision.stop_reason
        debugger.send("Debugger.resume")
        debugger.detach()
        if reason is StopReason.PILOT_SILENT:
            break
    phone.locator(".notice", has_text="lost contact with you").wait_for()
    assert world.mode is Mode.STOPPED, "a page that wakes up does not go on by itself"
    assert "lost contact with you" in phone.locator(".notice").inner_text()


def test_the_robot_stops_if_the_tab_crashes(phone: Any, world: World) -> None:
    drive(phone, world)
    with contextlib.suppress(Exception):  # nobody answers any more
        phone.goto("chrome://crash", timeout=10_000)
    wait_until_standing(world)


def test_the_robot_stops_if_the_link_falls_silent_and_waits_when_it_is_back(
    chromium: Any, world: World, proxy: BrokenWay
) -> None:
    context = chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    page = open_page(context, proxy.address)
    fingers = drive(page, world)
    proxy.fault = "silent"
    wait_until_standing(world)
    page.locator(".notice", has_text="Looking for").wait_for(timeout=40_000)
    page.locator("video-view.away").wait_for(timeout=40_000)
    frames = int(page.locator("video-view").get_attribute("data-frames"))
    proxy.fault = ""
    page.wait_for_function(
        "(n) => document.querySelector('video-view:not(.away)')?.dataset.frames > n", arg=frames
    )
    page.wait_for_selector("drive-pad.idle")
    page.wait_for_selector("[data-mode=train][aria-disabled=false]", timeout=40_000)
    page.wait_for_timeout(500)
    assert world.mode is Mode.STOPPED, "the finger is still down, and nothing is replayed"
    fingers.lift()
    drive(page, world).lift()
    context.close()


def test_a_stop_pressed_while_the_robot_is_out_of_reach_is_obeyed(
    chromium: Any, world: World, proxy: BrokenWay
) -> None:
    context = chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    page = open_page(context, proxy.address)
    choose(page, world, Mode.TRAIN)
    context.set_offline(True)
    proxy.fault = "silent"
    page.locator(".notice", has_text="does not answer").wait_for(timeout=40_000)
    with page.expect_event("requestfailed", lambda request: request.url.endswith("/api/stop")):
        page.locator("drive-pad .stop").tap()
    context.set_offline(False)
    proxy.fault = ""
    wait_until(lambda: world.rig.loop.state.emergency, "it is asked for until it is heard")
    context.close()
