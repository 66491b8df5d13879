"""Only shown pictures are sent over the link, and the cached page is enough to reconnect."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.config import Config
from tests.kit.wait import wait_until

from .hand import SET_HIDDEN
from .world import PHONE, World, open_page, running_world

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_no_pictures_are_sent_to_a_page_that_does_not_show_them(phone: Any, world: World) -> None:
    def frames() -> int:
        return int(phone.evaluate("document.querySelector('video-view').frames"))

    for place in ("teaching", "settings", "hidden"):
        if place == "hidden":
            phone.evaluate(SET_HIDDEN, True)
        else:
            phone.evaluate(f"location.hash = '{place}'")
        wait_until(
            lambda: world.services.hub.broadcast.video.viewers == 0, f"no pictures go to {place}"
        )
        drawn = frames()
        phone.wait_for_timeout(500)
        assert frames() == drawn, place
        phone.evaluate(SET_HIDDEN, False)
        phone.evaluate("location.hash = 'drive'")
        wait_until(lambda drawn=drawn: frames() > drawn, f"pictures come again after {place}")
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
