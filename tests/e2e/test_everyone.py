"""The page is for everyone: accessible, small, in three languages, there without a link."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robot.types import Mode

from .world import (
    COUNT_FETCHES,
    DESKTOP,
    PHONE,
    Fingers,
    World,
    choose,
    hold_until,
    open_page,
    running_world,
    settle,
    show,
)

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SCREENS = ("drive", "gallery", "why", "teaching", "undo", "lesson", "study", "home", "settings")
MOST_BYTES = 100_000
MOST_BYTES_FIRST = 70_000
MOST_REQUESTS_FIRST = 40
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


@pytest.fixture
def frame_rate_hz() -> float:
    """Many, so that what is taught first takes little time."""
    return 30.0


def complaints(page: Any) -> list[str]:
    """What axe-core finds wrong on the page as it is now."""
    found = page.evaluate(
        """async (tags) => (await axe.run({runOnly: tags})).violations.map(
             (v) => `${v.id}: ${v.nodes.map((n) => n.html.slice(0, 160)).join(' | ')}`)""",
        WCAG,
    )
    return list(found)


@pytest.mark.parametrize(("size", "scheme"), [(PHONE, "light"), (DESKTOP, "dark")])
def test_axe_finds_nothing_on_any_screen(
    chromium: Any, world: World, npm_modules: Path, size: dict[str, int], scheme: Any
) -> None:
    axe = (npm_modules / "axe-core" / "axe.min.js").read_text()
    context = chromium.new_context(
        viewport=size, color_scheme=scheme, has_touch=True, is_mobile=size is PHONE
    )
    page = open_page(context, world.address)
    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)
    hold_until(world, fingers, "left", lambda: world.lessons > 40)
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
    context.close()


def test_targets_are_large_enough_for_a_thumb(phone: Any, world: World) -> None:
    for screen in SCREENS:
        show(phone, screen)
        small = phone.evaluate(
            """() => [...document.querySelectorAll('button, a, select, label.choice')]
                 .filter((e) => e.checkVisibility())
                 .map((e) => [e.outerHTML.slice(0, 80), e.getBoundingClientRect()])
                 .filter(([, box]) => box.width < 44 || box.height < 44)
                 .map(([html, box]) => `${html} ${box.width}x${box.height}`)"""
        )
        assert small == [], screen


@pytest.mark.parametrize("size", [{"width": 360, "height": 640}, DESKTOP])
@pytest.mark.parametrize("language", ["en", "es", "zh"])
def test_nothing_is_cut_off_in_any_language(
    chromium: Any, world: World, language: str, size: dict[str, int]
) -> None:
    context = chromium.new_context(viewport=size, locale=language, has_touch=True)
    page = open_page(context, world.address)
    assert page.evaluate("document.documentElement.lang") == language
    for screen in SCREENS:
        show(page, screen)
        wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wide <= 0, f"{screen} is {wide} px too wide"
        cut = page.evaluate(
            """() => [...document.querySelectorAll('button, .button, h2, legend')]
                 .filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1)
                 .map((e) => e.textContent)"""
        )
        assert cut == [], screen
    context.close()


def test_the_budget(chromium: Any, world: World) -> None:
    context = chromium.new_context(viewport=PHONE, service_workers="block")
    page = context.new_page()
    page.add_init_script(COUNT_FETCHES)
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

    page.goto(world.address)
    page.wait_for_selector("video-view[data-frames]")
    first_frame_ms = page.evaluate("performance.getEntriesByName('first-frame')[0].startTime")
    first_bytes, first_requests = spent(), len(sizes)
    for screen in SCREENS:
        if screen == "study":  # fetched by those alone who run one
            continue
        show(page, screen)
    print(
        f"budget: first screen {first_bytes:.0f} bytes in {first_requests} requests, "
        f"first frame after {first_frame_ms:.0f} ms, all screens {spent():.0f} bytes"
    )
    assert first_bytes < MOST_BYTES_FIRST
    assert first_requests < MOST_REQUESTS_FIRST
    assert spent() < MOST_BYTES
    context.close()


def test_nothing_comes_from_another_host_and_nothing_fails(desktop: Any, world: World) -> None:
    asked: list[str] = []
    errors: list[str] = []
    desktop.on("request", lambda request: asked.append(request.url))
    desktop.on("pageerror", lambda error: errors.append(str(error)))
    desktop.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    desktop.reload()
    for screen in SCREENS:
        show(desktop, screen)
    ours = (world.address, world.address.replace("http", "ws"), "data:")
    assert [url for url in asked if not url.startswith(ours)] == []
    assert errors == []


def test_without_the_robot_the_page_still_opens_and_says_so(chromium: Any, tmp_path: Path) -> None:
    context = chromium.new_context(viewport=PHONE)
    with running_world(tmp_path / "first") as world:
        page = open_page(context, world.address)
        page.evaluate("navigator.serviceWorker.ready.then(() => true)")
        page.reload()
        page.wait_for_selector("video-view[data-frames]")
        page.wait_for_timeout(500)
        address = world.address
    page.locator(".notice", has_text="out of reach").wait_for(timeout=40_000)
    page.goto(address)
    page.locator(".notice", has_text="out of reach").wait_for(timeout=40_000)
    assert page.locator("drive-pad .move").count() == 3
    context.close()


def test_reduced_motion_moves_nothing(chromium: Any, world: World) -> None:
    context = chromium.new_context(viewport=PHONE, reduced_motion="reduce")
    page = open_page(context, world.address)
    moving = page.evaluate(
        """() => [...document.querySelectorAll('*')].filter((e) =>
             ['', '::before', '::after'].some((part) => {
               const style = getComputedStyle(e, part || null);
               return style.animationName !== 'none' || style.transitionDuration !== '0s';
             })).length"""
    )
    assert moving == 0
    context.close()


def test_the_first_visit_shows_three_hints_once(chromium: Any, tmp_path: Path) -> None:
    """Each when its moment has come, and nothing else is said beside it."""
    # This learner knows every view, so that nothing more urgent hides a hint.
    with running_world(tmp_path, learner="published-32", frame_rate_hz=30.0) as world:
        context = chromium.new_context(viewport=PHONE, has_touch=True)
        page = open_page(context, world.address, hints=True)
        fingers = Fingers(page)
        said = [_hint(page, "hold a direction")]
        choose(page, world, Mode.TRAIN)
        hold_until(world, fingers, "left", lambda: world.lessons > 70)
        said.append(_hint(page, "three bars"))
        fingers.lift()
        page.locator(".notice button", has_text="Got it").click()
        page.locator(".notice").wait_for(state="hidden")
        choose(page, world, Mode.AUTONOMOUS)
        said.append(_hint(page, "correct it"))
        page.locator(".notice button", has_text="Got it").click()
        assert len(set(said)) == 3
        choose(page, world, Mode.STOPPED)
        page.reload()
        page.wait_for_selector("video-view[data-frames]")
        assert page.locator(".notice button:visible", has_text="Got it").count() == 0
        context.close()


def _hint(page: Any, words: str) -> str:
    """Wait for a hint; while it is shown the panel's own advice is silent."""
    page.locator(".notice p", has_text=words).wait_for()
    assert page.locator("teach-panel p").inner_text() == ""
    return str(page.locator(".notice p").inner_text())
