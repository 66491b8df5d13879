"""A teacher's hour on the board, with real servers: one of them over https."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from robot.types import Action
from server.board.extension import ClassroomExtension
from tests.kit.wait import wait_until

from .class_world import running_class
from .world import PHONE

pytestmark = pytest.mark.browser


def test_the_board_renames_pairs_locks_copies_models_and_stops(
    chromium: Any, tmp_path: Path
) -> None:
    with running_class(tmp_path, 2, tls=1) as school:
        context = chromium.new_context(locale="en")
        page = context.new_page()
        page.goto(school.address)
        page.locator(".robot[data-status=there]").nth(1).wait_for()
        page.locator(".seen[data-frames]").nth(1).wait_for(timeout=40_000)

        def open_panel(number: int) -> None:
            page.locator(f"[data-number='{number}'] .acts button").last.click()

        # A name that the board sets becomes the robot's own name.
        open_panel(2)
        page.get_by_label("Name", exact=True).fill("Zora")
        page.get_by_label("Name", exact=True).blur()
        page.locator("[data-number='2'] h2", has_text="Zora").wait_for()
        assert school.robots[1].identity.now.name == "Zora"

        # Two phones scan one code; nobody has to type, and both can drive.
        there = school.board.robot(2).page_address()
        assert there is not None and "/pair#" in there
        phones = []
        for _ in range(2):
            phone = chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
            scanned = phone.new_page()
            scanned.goto(there)
            scanned.wait_for_selector("video-view[data-frames]", state="attached")
            phones.append(phone)

        # The robot itself refuses locked changes, to every client.
        page.get_by_label("models", exact=True).check()
        classroom = school.robots[1].extension(ClassroomExtension).classroom
        assert classroom is not None
        wait_until(lambda: classroom.locks == {"models"}, "the robot knows its lock")
        jar = {cookie["name"]: cookie["value"] for cookie in phones[0].cookies()}
        address = there.rsplit("/pair", 1)[0]
        assert httpx.post(f"{address}/api/models", cookies=jar).status_code == 423
        assert httpx.get(f"{address}/api/models", cookies=jar).status_code == 200

        # A model goes from the robot behind https to the other one, locked or not.
        page.locator("#panel .title button").click()
        source, target = (robot.persistence for robot in school.robots)
        assert source is not None and target is not None
        open_panel(1)
        page.locator("#panel .choice", has_text="Zora").locator("input").check()
        page.get_by_role("button", name="Copy and use it there").click()
        page.locator(".said", has_text="Done").wait_for()
        assert target.autosave.name in target.models.names()
        assert target.autosave.name == source.autosave.name

        # STOP acts when it is pressed, before it is released.
        box = page.locator("button.stop").bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.down()
        for robot in school.robots:
            wait_until(lambda r=robot: r.robot.loop.state.emergency, "STOP ALL reaches each")
            driver: Any = robot.robot.driver
            assert driver.now is Action.STOP
        page.mouse.up()

        # This is the teacher's stop: the phones say so and offer no release; the board offers it.
        pupil = phones[1].pages[0]
        pupil.locator(".notice", has_text="Your teacher has stopped the robot").wait_for()
        assert pupil.locator(".notice button:visible").count() == 0
        page.locator(".robot", has_text="Stopped by you").first.wait_for()
        page.get_by_role("button", name="Release all").click()
        for robot in school.robots:
            wait_until(lambda r=robot: not r.robot.loop.state.emergency, "each is released")

        # A key without a code, from a television's remote control, also stops.
        page.evaluate("document.activeElement.blur()")
        space = "new KeyboardEvent('keydown', {key: ' ', bubbles: true})"
        page.evaluate(f"document.body.dispatchEvent({space})")
        for robot in school.robots:
            wait_until(lambda r=robot: r.robot.loop.state.emergency, "space stops each")
        for phone in phones:
            phone.close()
        context.close()
