"""The page is never blank: a sentence and a working STOP are shown, whichever file does not
arrive."""

from __future__ import annotations

import re
from typing import Any

import pytest

from robot.types import Mode
from tests.kit.sizes import few
from tests.kit.wait import wait_until

from .hand import choose
from .world import PHONE, World, new_context, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow]

LOST = 3
FIRST = "#first button"


def lose(context: Any, part: str, times: int = LOST) -> list[str]:
    """Have the first requests for a part fail, as in a gap of the Wi-Fi; return the requests."""
    asked: list[str] = []

    def answer(route: Any) -> None:
        asked.append(route.request.url)
        if len(asked) <= times:
            route.abort()
        else:
            route.continue_()

    context.route(re.compile(rf"/[0-9a-f]{{10}}-{re.escape(part)}"), answer)
    return asked


@pytest.mark.parametrize("part", few(["drive.js", "page.css", "en.js", "video-worker.js"], 2))
def test_what_is_lost_is_fetched_again_and_stop_works_meanwhile(
    chromium: Any, world: World, part: str
) -> None:
    context = new_context(chromium, PHONE)
    asked = lose(context, part)
    page = context.new_page()
    page.goto(world.address)
    if part != "video-worker.js":  # without it the page itself draws
        page.locator("#first p", has_text="did not arrive").wait_for()
        page.locator(FIRST).tap()
        wait_until(lambda: world.rig.loop.state.emergency, "STOP works without the page")
    page.wait_for_selector("#first", state="detached", timeout=60_000)
    page.wait_for_selector("video-view[data-frames]", state="attached", timeout=60_000)
    assert len(asked) > (LOST if part != "video-worker.js" else 0)
    context.close()


def test_a_screen_that_is_lost_opens_by_itself(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE)
    asked = lose(context, "screens.js", 10_000)
    page = open_page(context, world.address)
    page.evaluate("location.hash = 'settings'")
    page.get_by_role("alert").filter(has_text="did not answer").wait_for()
    page.locator("app-bar .stop").tap()
    wait_until(lambda: world.rig.loop.state.emergency, "STOP is there all the time")
    context.unroute_all()
    page.get_by_label("Language").wait_for(timeout=60_000)
    assert asked
    context.close()


def test_a_screen_that_hangs_is_told_of_and_opens_when_it_comes(
    chromium: Any, world: World
) -> None:
    context = new_context(chromium, PHONE)
    held: list[Any] = []
    context.route(re.compile(r"/[0-9a-f]{10}-screens\.js"), lambda route: held.append(route))
    page = open_page(context, world.address)
    page.evaluate("location.hash = 'settings'")
    told = page.get_by_role("alert").filter(has_text="did not answer")
    told.wait_for()
    for route in held:
        route.continue_()
    page.get_by_label("Language").wait_for()
    assert told.count() == 0
    context.close()


def test_a_page_older_than_its_robot_opens_every_screen(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE)
    page = open_page(context, world.address)
    opened: list[str] = []

    def renew(route: Any) -> None:
        opened.append(route.request.url)
        route.continue_()

    # An updated robot has only the files that its own page requests.
    def answer(
        route: Any,
    ) -> None:
        route.continue_() if opened else route.fulfill(status=404)

    context.route(world.address + "/", renew)
    context.route(re.compile("/[0-9a-f]{10}-screens.js"), answer)
    page.evaluate("location.hash = 'settings'")
    page.get_by_label("Language").wait_for(timeout=60_000)
    assert len(opened) == 1
    context.close()


def test_a_browser_that_forgets_all_drives(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE)
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
    context.close()


@pytest.mark.parametrize(
    ("language", "word"), few([("zh-TW", "太旧"), ("es", "demasiado viejo"), ("en", "too old")], 1)
)
def test_an_old_browser_is_told_so_and_can_stop(
    chromium: Any, world: World, language: str, word: str
) -> None:
    context = new_context(chromium, PHONE, locale=language)
    context.add_init_script("delete HTMLScriptElement.prototype.noModule")
    page = context.new_page()
    page.goto(world.address)
    page.locator("#first p", has_text=word).wait_for()
    page.locator(FIRST).tap()
    wait_until(lambda: world.rig.loop.state.emergency, "STOP works in any browser")
    context.close()


def test_stop_works_without_any_script(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE, java_script_enabled=False)
    page = context.new_page()
    page.goto(world.address)
    page.locator("#first", has_text="It needs JavaScript").wait_for()
    page.locator(FIRST).tap()
    wait_until(lambda: world.rig.loop.state.emergency, "a form is enough")
    context.close()


def test_a_stop_that_is_not_answered_is_asked_again(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE)
    lose(context, "drive.js", 10_000)
    away = ["/api/stop"]
    context.route("**/api/stop", lambda route: route.abort() if away else route.continue_())
    page = context.new_page()
    page.goto(world.address)
    page.locator(FIRST).tap()
    page.locator("#first p", has_text="I keep asking").wait_for()
    away.clear()
    page.locator("#first p", has_text="has been stopped").wait_for()
    assert world.rig.loop.state.emergency, "it is asked until it is answered"
    context.close()
