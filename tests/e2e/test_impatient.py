"""People who go back and forth, or meet a robot that refuses, see the true state."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest

from tests.kit.wait import wait_until

from .world import PHONE, World, new_context, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_a_screen_left_and_opened_again_while_it_loads_is_shown_once(
    chromium: Any, world: World
) -> None:
    context = new_context(chromium, PHONE)
    held: list[Any] = []
    context.route(re.compile(r"/[0-9a-f]{10}-screens\.js"), lambda route: held.append(route))
    page = open_page(context, world.address)
    for screen in ("gallery", "drive", "gallery"):
        page.evaluate("(screen) => location.hash = screen", screen)
        page.wait_for_function("(screen) => document.body.dataset.screen === screen", arg=screen)
    told = page.get_by_role("alert").filter(has_text="did not answer")
    told.wait_for()
    for route in held:
        route.continue_()
    page.locator("gallery-screen .lead").first.wait_for()
    assert (page.locator("gallery-screen").count(), told.count()) == (1, 0)
    context.close()


def test_a_refused_or_changed_file_is_reported_and_not_shown_as_done(
    chromium: Any, world: World, tmp_path: Path
) -> None:
    plan, model = tmp_path / "plan.toml", tmp_path / "model.npz"
    for file in (plan, model):
        file.write_text("no plan, no model")
    context = new_context(chromium, PHONE)
    page = open_page(context, world.address)
    page.evaluate("location.hash = 'study'")
    page.get_by_label("Name of the study").fill("mine")
    page.locator("details select").select_option("plan")
    page.locator("input[type=file]").set_input_files(plan)
    page.get_by_role("button", name="Make the study").click()
    refusal = page.locator(".refusal")
    refusal.filter(has_text="TOML").wait_for()
    plan.write_text("what the teacher has mended in it")
    os.utime(plan, (0, 0))  # browsers compare whole seconds
    page.get_by_role("button", name="Make the study").click()
    refusal.filter(has_text="it has changed. Choose it again.").wait_for()

    page.evaluate("location.hash = 'home'")
    upload = page.locator("input[type=file]")
    upload.set_input_files(model)
    page.locator("toast-bar", has_text="model").wait_for()
    assert upload.input_value() == "", "the same file can be chosen again"

    page.evaluate("location.hash = 'settings'")
    speed = page.get_by_label("Speed")
    before = speed.input_value()

    def refuse(route: Any) -> None:
        if route.request.method == "PUT":
            route.fulfill(status=423, body='{"detail": "The teacher has locked this."}')
        else:
            route.continue_()

    context.route("**/api/settings", refuse)
    speed.fill("30" if before != "30" else "60")
    page.locator("toast-bar", has_text="locked").wait_for()
    wait_until(
        lambda: speed.input_value() == before or page.wait_for_timeout(50), "the speed is as before"
    )
    context.close()
