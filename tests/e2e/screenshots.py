"""Take the pictures of every screen for the docs, from the running program: make screenshots."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.e2e.world import (
    DESKTOP,
    LANDSCAPE,
    PHONE,
    Fingers,
    World,
    open_page,
    pad,
    running_chromium,
    running_world,
    teach,
)

SIZES = {"phone": PHONE, "desktop": DESKTOP}
SCREENS = ("gallery", "teaching", "undo", "home", "settings")


def take_all(folder: Path, only: str = "") -> None:
    """Write one PNG a screen, size and colour scheme."""
    folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as kept,
        running_world(Path(kept), world="office") as world,
        running_chromium() as browser,
    ):
        _take_hints(browser, world, folder, only)
        _teach_first(browser, world)
        for size, viewport in {**SIZES, "landscape": LANDSCAPE}.items():
            for scheme in ("light", "dark"):
                context = browser.new_context(
                    viewport=viewport,
                    color_scheme=scheme,
                    has_touch=True,
                    is_mobile=size != "desktop",
                )
                page = open_page(context, world.address)
                shoot = _shooter(page, folder, f"{size}-{scheme}", only)
                _take_drive(page, world, shoot)
                if size != "landscape":
                    for screen in SCREENS:
                        page.goto(f"{world.address}/#{screen}")
                        page.wait_for_timeout(1200)
                        shoot(screen)
                    _take_detail(page, world, shoot)
                context.close()


def _shooter(page: Any, folder: Path, ending: str, only: str) -> Callable[[str], None]:
    def shoot(name: str) -> None:
        if only in name:
            page.screenshot(path=folder / f"{name}-{ending}.png")

    return shoot


def _take_hints(browser: Any, world: World, folder: Path, only: str) -> None:
    for size, viewport in SIZES.items():
        for scheme in ("light", "dark"):
            context = browser.new_context(viewport=viewport, color_scheme=scheme)
            page = open_page(context, world.address, hints=True)
            page.wait_for_timeout(600)
            _shooter(page, folder, f"{size}-{scheme}", only)("hints")
            context.close()


def _teach_first(browser: Any, world: World) -> None:
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    page = open_page(context, world.address)
    page.locator("[data-mode=train]").tap()
    teach(world, Fingers(page), 500, near_m=0.5)
    page.locator("[data-mode=stopped]").tap()
    context.close()


def _take_drive(page: Any, world: World, shoot: Callable[[str], None]) -> None:
    page.locator("[data-mode=train]").tap()
    fingers = Fingers(page)
    page.wait_for_selector("drive-pad:not(.idle)")
    fingers.press(pad("left"))
    page.wait_for_timeout(1500)
    fingers.lift()
    fingers.press(pad("forward"))
    page.wait_for_timeout(500)
    shoot("teach")
    fingers.lift()
    page.locator("[data-mode=autonomous]").tap()
    page.wait_for_timeout(1200)
    shoot("drive")
    page.locator("drive-pad .stop").tap()
    page.wait_for_timeout(400)
    shoot("stop")
    page.locator(".notice button").tap()
    page.wait_for_selector(".notice button", state="hidden")
    page.locator("[data-mode=stopped]").tap()


def _take_detail(page: Any, world: World, shoot: Callable[[str], None]) -> None:
    page.goto(f"{world.address}/#gallery")
    page.locator(".card").nth(2).tap()
    page.wait_for_timeout(800)
    shoot("image")


if __name__ == "__main__":
    take_all(Path(sys.argv[1]), *sys.argv[2:3])
