"""Whichever file does not arrive, the page shows a sentence and a working STOP."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from robot.types import Mode
from tests.kit.sizes import few
from tests.kit.wait import wait_until

from .hand import choose
from .world import PHONE, World, new_context, open_page

SCREENS = re.compile(r"/[0-9a-f]{10}-screens\.js")


@pytest.fixture
def context(chromium: Any) -> Iterator[Any]:
    context = new_context(chromium, PHONE)
    yield context
    context.close()


def first(context: Any, world: World, text: str) -> Any:
    """Open the page, and return it with its first sentence, before any of its files has arrived."""
    page = context.new_page()
    page.goto(world.address)
    page.locator("#first", has_text=text).wait_for()
    return page


@pytest.mark.parametrize("part", few(["drive.js", "page.css", "en.js"], 1))
def test_a_lost_file_is_fetched_again_and_a_stop_is_repeated_until_answered(
    context: Any, world: World, part: str
) -> None:
    lost = re.compile(rf"/[0-9a-f]{{10}}-{re.escape(part)}")
    context.route(lost, lambda route: route.abort())
    context.route("**/api/stop", lambda route: route.abort())
    page = first(context, world, "did not arrive")
    page.locator("#first button").tap()
    page.locator("#first p", has_text="Asking it again to stop").wait_for()
    context.unroute("**/api/stop")
    page.locator("#first p", has_text="has been stopped").wait_for()
    assert world.rig.loop.state.emergency
    context.unroute(lost)
    page.wait_for_selector("#first", state="detached", timeout=60_000)
    page.wait_for_selector("video-view[data-frames]", state="attached", timeout=60_000)


def test_the_page_drives_without_its_worker_and_without_storage(context: Any, world: World) -> None:
    context.route(re.compile("-video-worker.js"), lambda route: route.abort())
    context.add_init_script(
        """for (const name of ['localStorage', 'sessionStorage'])
             Object.defineProperty(window, name,
               { get() { throw new DOMException('blocked', 'SecurityError'); } });"""
    )
    page = context.new_page()
    page.goto(world.address)
    page.wait_for_selector("video-view[data-frames]", state="attached", timeout=60_000)
    choose(page, world, Mode.TRAIN)
    page.evaluate("location.hash = 'settings'")
    page.get_by_label("Sounds").uncheck()


def test_a_lost_screen_opens_by_itself_and_is_shown_once(context: Any, world: World) -> None:
    context.route(SCREENS, lambda route: route.abort())
    page = open_page(context, world.address)
    for screen in ("gallery", "drive", "gallery"):
        page.evaluate("(screen) => location.hash = screen", screen)
        page.wait_for_function("(screen) => document.body.dataset.screen === screen", arg=screen)
    told = page.get_by_role("alert").filter(has_text="did not answer")
    told.wait_for()
    page.locator("app-bar .stop").tap()
    wait_until(lambda: world.rig.loop.state.emergency, "STOP works")
    context.unroute(SCREENS)
    page.locator("gallery-screen .lead").first.wait_for(timeout=60_000)
    assert (page.locator("gallery-screen").count(), told.count()) == (1, 0)


def test_a_page_older_than_its_robot_opens_every_screen(context: Any, world: World) -> None:
    page = open_page(context, world.address)
    opened: list[str] = []

    def renew(route: Any) -> None:
        opened.append(route.request.url)
        route.continue_()

    context.route(world.address + "/", renew)
    # An updated robot has only the files of its own page, not those of older pages.
    context.route(SCREENS, lambda route: route.continue_() if opened else route.fulfill(status=404))
    page.evaluate("location.hash = 'settings'")
    page.get_by_label("Language").wait_for(timeout=60_000)
    assert len(opened) == 1


OLD = "delete HTMLScriptElement.prototype.noModule"
BROWSERS = {
    "old": ({"locale": "en"}, OLD, "too old"),
    "old, in Spanish": ({"locale": "es"}, OLD, "demasiado viejo"),
    "old, in Chinese": ({"locale": "zh-TW"}, OLD, "太旧"),
    "without scripts": ({"java_script_enabled": False}, "", "It needs JavaScript"),
}


@pytest.mark.parametrize("browser", few(BROWSERS, 2))
def test_a_browser_that_cannot_run_the_page_is_told_so_and_can_stop(
    chromium: Any, world: World, browser: str
) -> None:
    options, script, text = BROWSERS[browser]
    context = new_context(chromium, PHONE, **options)
    context.add_init_script(script)
    first(context, world, text).locator("#first button").tap()
    wait_until(lambda: world.rig.loop.state.emergency, "STOP works without the page")
    context.close()
