"""People who tap twice, go back and forth, or meet a robot that refuses see the true state."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import pytest

from tests.kit.wait import wait_until

from .world import PHONE, World, new_context, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def outcome(move: str) -> dict[str, Any]:
    """Return one participant's result: nothing, except for the move's name."""
    shares = {move: [0.0, 1.0]}
    return {
        "moves": [move],
        "examples": 1,
        "interventions": 0,
        "recordings": [],
        "step_m": 0.5,
        "ssd": 0.0,
        "pilot": shares,
        "robot": shares,
        "ssd_per_move": {move: 0.0},
        "never_by_pilot": [],
        "never_by_robot": [],
    }


def study(name: str) -> dict[str, Any]:
    session = {"participant": "P01", "step": "done", "order": ["one"], "position": 1, "of": 1}
    return {
        "name": name,
        "title": f"Title of {name}",
        "participants": 2,
        "done": 1,
        "shows_result": True,
        "next_order": ["one"],
        "sessions": [{**session, "fault": ""}],
    }


class Studies:
    """Answers for two studies; requests for `slow` wait until `let_go`."""

    def __init__(self, context: Any, slow: str) -> None:
        self.slow, self.waiting = slow, list[Any]()
        context.route(re.compile("/api/studies"), self.answer)

    def answer(self, route: Any) -> None:
        if self.slow and route.request.url.endswith(self.slow):
            self.waiting.append(route)
        else:
            self.fulfil(route)

    def fulfil(self, route: Any) -> None:
        path = route.request.url.partition("/api/studies")[2]
        name = path.strip("/").partition("/")[0]
        body: Any = {"studies": ["first", "other"], "older": []}
        if "/sessions/" in path:
            body = {"conditions": [outcome("left")]}
        elif name:
            body = study(name)
        route.fulfill(body=json.dumps(body), content_type="application/json")

    def let_go(self) -> None:
        self.slow = ""
        for route in self.waiting:
            self.fulfil(route)


def open_screen(context: Any, world: World, screen: str) -> Any:
    page = open_page(context, world.address)
    page.evaluate("(screen) => location.hash = screen", screen)
    return page


def test_who_goes_back_while_a_screen_is_loaded_gets_it_once(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE)
    held: list[Any] = []
    context.route(re.compile(r"/[0-9a-f]{10}-screens\.js"), lambda route: held.append(route))
    page = open_screen(context, world, "gallery")
    wait_until(lambda: held or page.wait_for_timeout(50), "the screen is asked for")
    for screen in ("drive", "gallery"):
        page.evaluate("(screen) => location.hash = screen", screen)
        page.wait_for_function("(screen) => document.body.dataset.screen === screen", arg=screen)
    for route in held:
        route.continue_()
    page.locator("gallery-screen .lead").first.wait_for()
    assert page.locator("gallery-screen").count() == 1
    context.close()


def test_what_is_shown_belongs_to_the_study_and_participant_that_were_chosen(
    chromium: Any, world: World
) -> None:
    context = new_context(chromium, PHONE)
    studies = Studies(context, "/studies/other")
    page = open_screen(context, world, "study")
    which, title = page.get_by_label("Study", exact=True), page.locator("h2", has_text="Title of")
    title.wait_for()
    which.select_option("other")
    wait_until(lambda: studies.waiting or page.wait_for_timeout(50), "one study takes its time")
    which.select_option("first")
    with page.expect_response(re.compile("/studies/other")):
        studies.let_go()
    page.wait_for_function("() => new Promise((done) => setTimeout(() => done(true), 50))")
    assert (title.inner_text(), which.input_value()) == ("Title of first", "first")

    # A result that arrives while something else is shown is not shown there.
    studies.slow, studies.waiting = "/sessions/P01", []
    page.locator("[role=listitem] button").first.click()
    wait_until(lambda: studies.waiting or page.wait_for_timeout(50), "so does a result")
    page.locator("study-screen h2 + button").click()
    title.wait_for()
    with page.expect_response(re.compile("/sessions/P01")):
        studies.let_go()
    page.wait_for_function("() => new Promise((done) => setTimeout(() => done(true), 50))")
    assert page.locator(".profiles").count() == 0
    page.locator("[role=listitem] button").first.click()
    page.locator(".profiles").wait_for()
    context.close()


def test_a_file_that_has_changed_since_it_was_chosen_is_asked_for_again(
    chromium: Any, world: World, tmp_path: Path
) -> None:
    plan, model = tmp_path / "plan.toml", tmp_path / "model.npz"
    for file in (plan, model):
        file.write_text("no plan, no model")
    context = new_context(chromium, PHONE)
    page = open_screen(context, world, "study")
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
    context.close()


def test_what_is_refused_or_lost_is_not_shown_as_done(chromium: Any, world: World) -> None:
    context = new_context(chromium, PHONE)
    page = open_screen(context, world, "settings")
    speed = page.get_by_label("Speed")
    speed.wait_for()
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

    lost: list[str] = []

    def lose_once(route: Any) -> None:
        lost.append(route.request.url)
        route.abort() if len(lost) == 1 else route.continue_()

    context.route("**/api/teaching", lose_once)
    page.evaluate("location.hash = 'teaching'")
    page.locator(".chart .hint, .chart svg").wait_for()
    assert len(lost) > 1
    context.close()
