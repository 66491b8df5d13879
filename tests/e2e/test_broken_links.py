"""If the path from a page to its robot breaks, the robot stops, and all pages show the truth.

tests/faults checks how soon the robot stops, and tests/web/way.test.mjs which sentence belongs to
which fault.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from robot.types import Action, Mode, StopReason
from server.config import Config
from tests.kit.wait import wait_until

from .broken_way import BrokenWay
from .hand import SET_HIDDEN, Fingers, choose, hold_until, pad, turning, wait_until_standing
from .world import (
    PHONE,
    World,
    new_context,
    open_page,
    running_world,
    sentences,
    wait_until_free,
)


@pytest.fixture
def way(world: World) -> Iterator[BrokenWay]:
    running = BrokenWay(int(world.address.rsplit(":", 1)[1]))
    yield running
    running.close()


@pytest.fixture
def far_phone(chromium: Any, way: BrokenWay) -> Iterator[Any]:
    """The page on a phone, behind the network that a test can break."""
    context = new_context(chromium, PHONE, locale="en")
    yield open_page(context, way.address)
    context.close()


def drive(page: Any, world: World) -> Fingers:
    """Have a finger turn the robot."""
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    hold_until(world, fingers, "left", turning(world))
    return fingers


def test_the_robot_stops_if_the_pages_main_thread_hangs(phone: Any, world: World) -> None:
    # A pause of the computer also stops the robot, because the pictures are too old then.
    for _ in range(5):
        drive(phone, world)
        debugger = phone.context.new_cdp_session(phone)
        debugger.send("Debugger.enable")
        # the page pauses at the next line that it runs, which belongs to a heartbeat
        debugger.send("Debugger.pause")
        wait_until_standing(world)
        reason = world.rig.loop.state.decision.stop_reason
        debugger.send("Debugger.resume")
        debugger.detach()
        if reason is StopReason.PILOT_SILENT:
            break
    phone.locator(".notice", has_text="lost contact with you").wait_for()
    assert world.mode is Mode.STOPPED, "a page that wakes up does not start the robot again"


def test_the_robot_stops_if_the_link_falls_silent_and_waits_when_it_is_back(
    far_phone: Any, world: World, way: BrokenWay
) -> None:
    page, fingers = far_phone, drive(far_phone, world)
    way.fault = "silent"
    wait_until_standing(world)
    page.locator(".notice", has_text="Looking for").wait_for(timeout=40_000)
    page.locator("video-view.away").wait_for(timeout=40_000)
    frames = int(page.locator("video-view").get_attribute("data-frames"))
    way.fault = ""
    page.wait_for_function(
        "(n) => document.querySelector('video-view:not(.away)')?.dataset.frames > n", arg=frames
    )
    page.wait_for_selector("drive-pad.idle")
    page.wait_for_selector("[data-mode=train][aria-disabled=false]", timeout=40_000)
    page.wait_for_timeout(500)
    assert world.mode is Mode.STOPPED, "the finger is still down, but nothing is replayed"
    fingers.lift()
    drive(page, world).lift()


def test_a_stop_pressed_while_the_robot_is_out_of_reach_is_obeyed(
    far_phone: Any, world: World, way: BrokenWay
) -> None:
    page = far_phone
    choose(page, world, Mode.TRAIN)
    page.context.set_offline(True)
    way.fault = "silent"
    page.locator(".notice", has_text="does not answer").wait_for(timeout=40_000)
    with page.expect_event("requestfailed", lambda request: request.url.endswith("/api/stop")):
        page.locator("drive-pad .stop").tap()
    page.context.set_offline(False)
    way.fault = ""
    wait_until(lambda: world.rig.loop.state.emergency, "the STOP is repeated until it arrives")


def test_a_page_reports_blocked_websockets_and_requests_pictures_instead(
    far_phone: Any, way: BrokenWay
) -> None:
    """The first network blocks websockets; the second has a gateway that reaches no robot."""
    words = sentences("en")
    way.fault = "websockets blocked"
    far_phone.locator(".notice p", has_text=words["way.blocked.stands"]).wait_for()
    far_phone.locator(".notice button").click()
    still = "document.querySelector('img.still')?.naturalWidth"
    wait_until(lambda: far_phone.evaluate(still) > 0, "a picture arrives by request")
    way.fault = "gateway"
    far_phone.locator(".notice p", has_text=words["way.gateway"]).wait_for()
    way.fault = ""
    far_phone.wait_for_selector("video-view:not(.away)[data-frames]")


def test_a_second_tab_watches_requests_the_wheel_and_takes_over(
    chromium: Any, phone: Any, world: World
) -> None:
    context = new_context(chromium, PHONE)
    second = open_page(context, world.address)
    second.locator(".notice", has_text="Somebody else has the wheel").wait_for()
    assert second.locator("[data-mode=train]").is_disabled()
    fingers = drive(phone, world)
    others = Fingers(second)
    others.press(pad("forward"))
    second.wait_for_timeout(300)
    assert world.action is not Action.FORWARD, "a viewer cannot drive"
    others.lift()
    second.locator(".notice button").tap()
    phone.locator(".notice button", has_text="Hand over the wheel").wait_for()
    reason = world.rig.loop.state.decision.stop_reason
    is_slow = reason in (StopReason.LINK_SLOW, StopReason.FRAME_STALE)
    assert world.action is Action.LEFT or is_slow, "a request for the wheel does not stop the robot"
    fingers.lift()
    phone.locator(".notice button").tap()
    wait_until_free(second)
    second.locator(".notice", has_text="You have the wheel now").wait_for()
    assert world.mode is Mode.STOPPED, "the robot stops when the wheel changes hands"
    second.locator("drive-pad .stop").tap()
    wait_until(lambda: world.rig.loop.state.emergency, "the STOP is obeyed")
    context.close()


def test_no_pictures_are_sent_to_a_page_that_does_not_show_them(phone: Any, world: World) -> None:
    for hide, show in (
        ("location.hash = 'settings'", "location.hash = 'drive'"),
        (f"({SET_HIDDEN})(true)", f"({SET_HIDDEN})(false)"),
    ):
        phone.evaluate(hide)
        wait_until(lambda: world.services.hub.broadcast.video.viewers == 0, hide)
        phone.evaluate(show)
        wait_until(lambda: world.services.hub.broadcast.video.viewers == 1, show)
    assert world.services.hub.lease.owner is not None, "the page still has the wheel"


def test_after_one_visit_the_page_opens_without_the_robot(chromium: Any, tmp_path: Path) -> None:
    context = chromium.new_context(viewport=PHONE)
    with running_world(tmp_path) as world:
        page = open_page(context, world.address)
        page.evaluate("navigator.serviceWorker.ready.then(() => true)")
        page.wait_for_function("() => navigator.serviceWorker.controller !== null")
        address, port = world.address, int(world.address.rsplit(":", 1)[1])
    page.goto(address)
    page.locator(".notice", has_text="does not answer").wait_for(timeout=40_000)
    for screen in ("gallery", "study", "teaching", "undo", "home", "settings"):
        page.evaluate(f"location.hash = '{screen}'")
        page.wait_for_selector(f"{screen}-screen", state="attached")
    page.evaluate("location.hash = 'drive'")
    with running_world(tmp_path, config=Config(port=port, data=tmp_path)):
        page.wait_for_selector("video-view:not(.away)[data-frames]", timeout=40_000)
        assert page.locator("drive-pad .move").count() == 3
    context.close()
