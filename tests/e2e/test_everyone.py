"""The page is accessible and small, is read out in order, and respects the wish for less motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot.types import Mode
from tests.kit.sizes import few

from .hand import Fingers, choose, hold_until
from .world import (
    COUNT_FETCHES,
    DESKTOP,
    PHONE,
    World,
    new_context,
    open_page,
    settle,
    show,
)

SCREENS = ("drive", "gallery", "why", "teaching", "undo", "challenge", "study", "home", "settings")
MOST_BYTES = 85_000
MOST_BYTES_STUDY = 8_000
MOST_REQUESTS_FIRST = 12
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


def complaints(page: Any, rules: list[str] = WCAG) -> list[str]:
    """The faults that axe-core finds on the current page."""
    found = page.evaluate(
        """async (tags) => (await axe.run({runOnly: tags, resultTypes: ['violations']}))
             .violations.map((v) => `${v.id}: ` +
                v.nodes.map((n) => n.html.slice(0, 160)).join(' | '))""",
        rules,
    )
    return list(found)


def in_both_schemes(page: Any) -> list[str]:
    """All faults with light colours, and the faults of contrast with dark colours."""
    found = complaints(page)
    page.emulate_media(color_scheme="dark")
    found += complaints(page, ["color-contrast"])
    page.emulate_media(color_scheme="light")
    return found


@pytest.mark.parametrize(
    ("size", "language"), few([(PHONE, "es"), (DESKTOP, "en"), (PHONE, "zh")], 1)
)
def test_axe_finds_nothing_on_any_screen_and_each_target_has_room_for_a_thumb(
    chromium: Any, world: World, npm_modules: Path, size: dict[str, int], language: str
) -> None:
    context = new_context(chromium, size, color_scheme="light", has_touch=True, locale=language)
    page = open_page(context, world.address)
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    hold_until(world, fingers, "left", lambda: world.lessons > 8)
    page.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
    assert in_both_schemes(page) == [], "the screen is accessible in training"
    fingers.lift()
    choose(page, world, Mode.AUTONOMOUS)
    assert in_both_schemes(page) == [], "the screen is accessible while the robot drives by itself"
    page.locator("drive-pad .stop").click()
    page.locator(".notice button").wait_for()
    assert in_both_schemes(page) == [], "the screen is accessible after an emergency stop"
    page.locator("app-bar [aria-controls=menu]").click()
    assert in_both_schemes(page) == [], "the screen is accessible with the menu open"
    for screen in (*SCREENS[1:], "drive"):
        show(page, screen)
        opened = {"gallery": ".card", "home": ".model .quiet"}.get(screen)
        if opened:
            page.locator(opened).first.click()
            settle(page)
        if screen != "drive":
            assert in_both_schemes(page) == [], screen
        assert size is not PHONE or page.evaluate(TOO_SMALL) == [], screen
    context.close()


TOO_SMALL = """() => [...document.querySelectorAll('button, a, select, label.choice')]
  .filter((e) => e.checkVisibility())
  .map((e) => [e.outerHTML.slice(0, 80), e.getBoundingClientRect()])
  .filter(([, box]) => box.width < 44 || box.height < 44)
  .map(([html, box]) => `${html} ${box.width}x${box.height}`)"""
"""The elements that are too small for a thumb."""
MOVING = """() => [...document.querySelectorAll('*')].filter((e) =>
  ['', '::before', '::after'].some((part) => {
    const style = getComputedStyle(e, part || null);
    return style.animationName !== 'none' || style.transitionDuration !== '0s';
  })).length"""
"""The number of elements that move although reduced motion is requested."""


def test_all_screens_are_small_load_only_from_the_robot_and_do_not_move(
    chromium: Any, rover: World
) -> None:
    """The limit excludes pictures and answers, whose sizes depend on what was taught.
    tests/web/test_bundle.py checks the limit of the first visit."""
    context = new_context(chromium, PHONE)
    page = context.new_page()
    asked: list[str] = []
    errors: list[str] = []
    sizes: dict[str, int] = {}
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)

    def note(response: dict[str, Any]) -> None:
        is_answer = "/api/" in response["response"]["url"]
        if response["type"] not in ("Image", "WebSocket") and not is_answer:
            sizes[response["requestId"]] = 0

    def count(done: dict[str, Any]) -> None:
        if done["requestId"] in sizes:
            sizes[done["requestId"]] = done["encodedDataLength"]

    cdp = context.new_cdp_session(page)
    cdp.send("Network.enable")
    cdp.on("Network.responseReceived", note)
    cdp.on("Network.loadingFinished", count)
    page.add_init_script(COUNT_FETCHES)
    page.goto(rover.address)
    page.wait_for_selector("video-view[data-frames]")
    assert page.evaluate(MOVING) == 0
    first = sum(sizes.values())
    assert len(sizes) <= MOST_REQUESTS_FIRST
    for screen in SCREENS:
        if screen != "study":
            show(page, screen)
    every = sum(sizes.values())
    assert 0 < first < every < MOST_BYTES
    show(page, "study")  # only people who run a study fetch these files
    assert 0 < sum(sizes.values()) - every < MOST_BYTES_STUDY
    ours = (rover.address, rover.address.replace("http", "ws"), "data:")
    assert [url for url in asked if not url.startswith(ours)] == []
    assert errors == []
    context.close()


def hears(page: Any, told: str) -> None:
    """Check that a screen reader reads out these names in this order, with these states; it may
    also read out others between them."""
    from playwright.sync_api import expect

    expect(page.locator("body")).to_match_aria_snapshot(told, timeout=60_000)


DRIVING = """
- banner:
  - heading "Rover" [level=1]
  - button "Menu"
- main:
  - img "What the robot sees"
  - group /What the robot would do/
  - status
  - radiogroup "Mode":
    - radio "Stop" [checked=false]
    - radio "Teach" [checked]
    - radio "Drive itself" [checked=false]
  - group "Hold to drive":
    - button "Forward" [pressed=false]
    - button "Left" [pressed]
    - button "Right"
  - button "STOP"
"""
STOPPED = """
- main:
  - status:
    - button
  - radiogroup "Mode":
    - radio "Stop" [disabled]
    - radio "Teach" [disabled]
    - radio "Drive itself" [disabled]
"""


def test_driving_is_read_out_in_the_order_of_its_use(rovers_desktop: Any, rover: World) -> None:
    page = rovers_desktop
    choose(page, rover, Mode.TRAIN)
    page.keyboard.down("ArrowLeft")
    hears(page, DRIVING)
    page.keyboard.up("ArrowLeft")
    page.locator("drive-pad .stop").click()
    hears(page, STOPPED)


def focused(page: Any) -> str:
    """Return the name of the focused element."""
    name: str = page.evaluate(
        """() => {
          const { activeElement: e } = document;
          return e.getAttribute('aria-label') ?? e.value ?? e.textContent.slice(0, 40);
        }"""
    )
    return name


def test_the_focus_stays_on_what_was_changed(rovers_desktop: Any, rover: World) -> None:
    page = rovers_desktop
    show(page, "settings")
    for control, key, after in (
        (page.locator("[name=size]:checked"), "ArrowDown", "64"),
        (page.locator("[type=checkbox][value=backward]"), "Space", "backward"),
        (page.get_by_label("Place", exact=True), "ArrowUp", "Place"),
    ):
        before = page.locator("settings-screen fieldset").first.element_handle()
        control.focus()
        page.keyboard.press(key)
        page.wait_for_function("(e) => !e.isConnected", arg=before)
        settle(page)
        assert focused(page) == after
    show(page, "home")
    page.locator("home-screen .model button[aria-expanded]").first.focus()
    name = focused(page)
    for _ in range(2):
        page.keyboard.press("Enter")
        settle(page)
        assert focused(page) == name


def test_a_menu_that_is_left_gives_the_focus_back(rovers_desktop: Any) -> None:
    page = rovers_desktop
    page.get_by_role("button", name="Menu").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert focused(page) == "Drive"
    page.keyboard.press("Escape")
    assert focused(page) == "Menu"
