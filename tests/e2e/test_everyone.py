"""The page is for everyone: accessible, small, in three languages, and shown without a link."""

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

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SCREENS = ("drive", "gallery", "why", "teaching", "undo", "challenge", "study", "home", "settings")
MOST_BYTES = 85_000
MOST_BYTES_FIRST = 48_000
MOST_BYTES_STUDY = 8_000
MOST_REQUESTS_FIRST = 12
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


@pytest.fixture
def frame_rate_hz() -> float:
    """A high rate, so that the first teaching takes little time."""
    return 15.0


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
    """All faults in light colours, and those of the contrast in dark ones."""
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
    hold_until(world, fingers, "left", lambda: world.lessons > 20)
    page.evaluate((npm_modules / "axe-core" / "axe.min.js").read_text())
    assert in_both_schemes(page) == [], "while driving"
    fingers.lift()
    choose(page, world, Mode.AUTONOMOUS)
    assert in_both_schemes(page) == [], "while it drives itself"
    page.locator("drive-pad .stop").click()
    page.locator(".notice button").wait_for()
    assert in_both_schemes(page) == [], "after an emergency stop"
    page.locator("app-bar [aria-controls=menu]").click()
    assert in_both_schemes(page) == [], "with the menu open"
    for screen in (*SCREENS[1:], "drive"):
        show(page, screen)
        opened = {"gallery": ".card", "home": ".model .quiet"}.get(screen)
        if opened:
            page.locator(opened).first.click()
            settle(page)
        if screen != "drive":
            assert in_both_schemes(page) == [], screen
        assert size is not PHONE or too_small(page) == [], screen
    context.close()


def too_small(page: Any) -> list[str]:
    """The elements of the current page that are too small for a thumb."""
    found = page.evaluate(
        """() => [...document.querySelectorAll('button, a, select, label.choice')]
             .filter((e) => e.checkVisibility())
             .map((e) => [e.outerHTML.slice(0, 80), e.getBoundingClientRect()])
             .filter(([, box]) => box.width < 44 || box.height < 44)
             .map(([html, box]) => `${html} ${box.width}x${box.height}`)"""
    )
    return list(found)


def test_all_screens_cost_little_come_from_the_robot_alone_and_hold_still(
    chromium: Any, rover: World
) -> None:
    """The budget does not count pictures and answers, whose sizes depend on what was taught."""
    context = new_context(chromium, PHONE, reduced_motion="reduce")
    page = context.new_page()
    page.add_init_script(COUNT_FETCHES)
    asked: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    cdp = context.new_cdp_session(page)
    cdp.send("Network.enable")
    sizes: dict[str, float] = {}
    pictures: set[str] = set()

    def note(response: dict[str, Any]) -> None:
        if response["type"] in ("Image", "WebSocket") or "/api/" in response["response"]["url"]:
            pictures.add(response["requestId"])

    cdp.on("Network.responseReceived", note)
    cdp.on(
        "Network.loadingFinished",
        lambda event: sizes.update({event["requestId"]: event["encodedDataLength"]}),
    )

    def spent() -> float:
        return sum(size for key, size in sizes.items() if key not in pictures)

    page.goto(rover.address)
    page.wait_for_selector("video-view[data-frames]")
    first = spent()
    assert 0 < first < MOST_BYTES_FIRST and 0 < len(sizes) <= MOST_REQUESTS_FIRST
    assert page.evaluate(MOVING) == 0
    for screen in SCREENS:
        if screen != "study":
            show(page, screen)
    every = spent()
    assert first < every < MOST_BYTES
    show(page, "study")  # only fetched by people who run one
    assert 0 < spent() - every < MOST_BYTES_STUDY
    ours = (rover.address, rover.address.replace("http", "ws"), "data:")
    assert [url for url in asked if not url.startswith(ours)] == []
    assert errors == []
    context.close()


MOVING = """() => [...document.querySelectorAll('*')].filter((e) =>
  ['', '::before', '::after'].some((part) => {
    const style = getComputedStyle(e, part || null);
    return style.animationName !== 'none' || style.transitionDuration !== '0s';
  })).length"""
"""The number of elements that move although the person wants less motion."""
