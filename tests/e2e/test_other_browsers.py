"""The whole loop in Firefox and WebKit: open, hold, train, let it drive, stop.

Playwright brings both browsers, because it drives no others: `playwright install firefox webkit`.
"""

from __future__ import annotations

import os

import pytest

from robot.types import DrivenBy, Mode
from tests.kit.wait import wait_until

from .hand import choose, pad, press_until
from .world import DESKTOP, PATIENCE_MS, World, new_context, open_page, show

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not os.environ.get("DRIVELESSON_OTHER_BROWSERS"),
        reason="THE PAGE WAS NOT TESTED IN FIREFOX AND WEBKIT: make test-browsers",
    ),
]


@pytest.mark.parametrize("world", ["box"], indirect=True)
@pytest.mark.parametrize("name", ["firefox", "webkit"])
def test_teach_drive_and_stop(name: str, world: World) -> None:
    from playwright.sync_api import Error, sync_playwright

    loop, start = world.rig.loop, world.pose
    with sync_playwright() as playwright:
        try:
            browser = getattr(playwright, name).launch()
        except Error as error:
            pytest.skip(f"THE PAGE WAS NOT TESTED IN {name.upper()}: {error}")
        context = new_context(browser, DESKTOP)
        context.set_default_timeout(PATIENCE_MS)
        page = open_page(context, world.address)
        choose(page, world, Mode.TRAIN)
        for move in ("forward", "left", "forward"):
            wanted = world.lessons + 12
            page.locator(pad(move)).hover()
            down, up = page.mouse.down, page.mouse.up
            press_until(page, world, down, up, lambda n=wanted: world.lessons >= n)
            up()
        assert world.pose != start, "the pilot's hand drove the robot"
        page.locator("teach-panel strong", has_text="%").wait_for()
        choose(page, world, Mode.AUTONOMOUS)
        wait_until(
            lambda: (
                loop.state.decision.driven_by is DrivenBy.ROBOT or loop.state.decision.asks_pilot
            ),
            "it drives, or asks",
        )
        page.locator("drive-pad .stop").click()
        wait_until(lambda: loop.state.emergency, "STOP is latched")
        page.wait_for_selector("mode-bar [data-mode=train][aria-disabled=true]")
        for screen in ("gallery", "home", "settings"):
            show(page, screen)
            assert page.locator(f"{screen}-screen button").count() > 0
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "not too wide"
        browser.close()
