"""The page is for everyone: accessible, small, in three languages, and shown without a link."""

from __future__ import annotations

from dataclasses import dataclass, field
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


def complaints(page: Any) -> list[str]:
    """The faults that axe-core finds on the current page."""
    found = page.evaluate(
        """async (tags) => (await axe.run({runOnly: tags, resultTypes: ['violations']}))
             .violations.map((v) => `${v.id}: ` +
                v.nodes.map((n) => n.html.slice(0, 160)).join(' | '))""",
        WCAG,
    )
    return list(found)


@pytest.mark.parametrize(
    ("size", "scheme", "language"),
    few([(PHONE, "light", "es"), (PHONE, "dark", "en"), (DESKTOP, "dark", "zh")], 2),
)
def test_axe_finds_nothing_on_any_screen_and_each_target_has_room_for_a_thumb(
    chromium: Any,
    world: World,
    npm_modules: Path,
    size: dict[str, int],
    scheme: Any,
    language: str,
) -> None:
    axe = (npm_modules / "axe-core" / "axe.min.js").read_text()
    context = new_context(chromium, size, color_scheme=scheme, has_touch=True, locale=language)
    page = open_page(context, world.address)
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    hold_until(world, fingers, "left", lambda: world.lessons > 20)
    page.evaluate(axe)
    assert complaints(page) == [], "while driving"
    fingers.lift()
    choose(page, world, Mode.AUTONOMOUS)
    assert complaints(page) == [], "while it drives itself"
    page.locator("drive-pad .stop").click()
    page.locator(".notice button").wait_for()
    assert complaints(page) == [], "after an emergency stop"
    page.locator("app-bar [aria-controls=menu]").click()
    assert complaints(page) == [], "with the menu open"
    for screen in SCREENS[1:]:
        show(page, screen)
        if screen == "gallery":
            page.locator(".card").first.click()
            settle(page)
        if screen == "home":
            page.locator(".model .quiet").first.click()
            settle(page)
        assert complaints(page) == [], screen
        assert size is not PHONE or too_small(page) == [], screen
    show(page, "drive")
    assert size is not PHONE or too_small(page) == []
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


@dataclass
class Visit:
    """The number of bytes that a visit to all screens costs, and its targets."""

    first_bytes: float = 0.0
    first_requests: int = 0
    bytes: float = 0.0
    """All screens except that of a study, which is only fetched by people who run one."""
    study_bytes: float = 0.0
    asked: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def visit(chromium: Any, rover: World) -> Visit:
    """One visit to all screens."""
    visit = Visit()
    context = new_context(chromium, PHONE)
    page = context.new_page()
    page.add_init_script(COUNT_FETCHES)
    page.on("request", lambda request: visit.asked.append(request.url))
    page.on("pageerror", lambda error: visit.errors.append(str(error)))
    page.on("console", lambda m: visit.errors.append(m.text) if m.type == "error" else None)
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
    first_frame_ms = page.evaluate("performance.getEntriesByName('first-frame')[0].startTime")
    visit.first_bytes, visit.first_requests = spent(), len(sizes)
    for screen in sorted(SCREENS, key=lambda screen: screen == "study"):
        if screen == "study":
            visit.bytes = spent()
        show(page, screen)
    visit.study_bytes = spent() - visit.bytes
    print(
        f"budget: first screen {visit.first_bytes:.0f} bytes in {visit.first_requests} requests, "
        f"first frame after {first_frame_ms:.0f} ms, all screens {visit.bytes:.0f} bytes, "
        f"study {visit.study_bytes:.0f}"
    )
    context.close()
    return visit


def test_the_budget(visit: Visit) -> None:
    assert 0 < visit.first_bytes < MOST_BYTES_FIRST
    assert 0 < visit.first_requests <= MOST_REQUESTS_FIRST
    assert visit.first_bytes < visit.bytes < MOST_BYTES
    assert 0 < visit.study_bytes < MOST_BYTES_STUDY


def test_nothing_comes_from_another_host_and_nothing_fails(visit: Visit, rover: World) -> None:
    ours = (rover.address, rover.address.replace("http", "ws"), "data:")
    assert len(visit.asked) > visit.first_requests
    assert [url for url in visit.asked if not url.startswith(ours)] == []
    assert visit.errors == []


def test_reduced_motion_moves_nothing(chromium: Any, rover: World) -> None:
    context = new_context(chromium, PHONE, reduced_motion="reduce")
    page = open_page(context, rover.address)
    moving = page.evaluate(
        """() => [...document.querySelectorAll('*')].filter((e) =>
             ['', '::before', '::after'].some((part) => {
               const style = getComputedStyle(e, part || null);
               return style.animationName !== 'none' || style.transitionDuration !== '0s';
             })).length"""
    )
    assert moving == 0
    context.close()
