"""Takes the pictures of every screen for the docs from the running program: make screenshots.

The world is simulated; no picture shows a real place.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import httpx

from robot.study.session import SessionStep
from server.access.config import NetworkConfig
from server.access.pairing import Pairing
from server.study.conductor import Conductor
from tests.server.live_robot import WEB, live_server

from .broken_way import BrokenWay
from .class_world import running_class
from .film import take_film
from .hand import Fingers, choose, drive_on, pad, teach
from .test_study import PLAN, conductor_of
from .world import (
    DESKTOP,
    LANDSCAPE,
    PHONE,
    World,
    finish_recording,
    new_context,
    open_page,
    passing_world,
    running_chromium,
)

SMALL = {"width": 320, "height": 480}
LIGHT = {
    "phone": (PHONE, "light"),
    "small": (SMALL, "light"),
    "landscape": (LANDSCAPE, "light"),
    "desktop": (DESKTOP, "light"),
}
"""The sizes and colour schemes, by the endings of the pictures' names."""
ALSO_DARK = {**LIGHT, "phone-dark": (PHONE, "dark")}
SCREENS = ("gallery", "why", "teaching", "undo", "home", "settings")
Looks = dict[str, tuple[Any, str]]
Shoot = Callable[[str], None]
_QUALITY = 85


def take_all(folder: Path, only: Sequence[str] = ()) -> None:
    """Write one picture for each screen and size, NAME-SIZE.webp, for docs/reference/screens.md."""
    folder.mkdir(parents=True, exist_ok=True)
    with running_chromium() as browser:
        for name, take in PARTS.items():
            if not only or name in only:
                take(browser, folder)


def _take_office(browser: Any, folder: Path) -> None:
    with passing_world("office") as world:
        _each(browser, world, folder, _take_hints, hints=True)
        _teach_first(browser, world)
        _each(browser, world, folder, _take_drive, looks=ALSO_DARK)
        finish_recording(world)
        _each(browser, world, folder, _take_screens)
        _take_away(browser, world, folder)


def _take_trial(browser: Any, folder: Path) -> None:
    with passing_world("box") as world:
        _hold_trial(browser, world)
        _each(browser, world, folder, _take_result)


def _each(
    browser: Any,
    world: World,
    folder: Path,
    take: Callable[[Any, World, Shoot], None],
    *,
    looks: Looks = LIGHT,
    hints: bool = False,
) -> None:
    for ending, context in _contexts(browser, looks):
        page = open_page(context, world.address, hints=hints)

        def shoot(name: str, page: Any = page, ending: str = ending) -> None:
            _save(page.screenshot(), folder / f"{name}-{ending}.webp")

        take(page, world, shoot)


def _contexts(browser: Any, looks: Looks = LIGHT) -> Iterator[tuple[str, Any]]:
    """Yield a fresh browser of each size and colour scheme, with the ending of its pictures'
    names."""
    for ending, (viewport, scheme) in looks.items():
        context = new_context(browser, viewport, color_scheme=scheme, has_touch=True)
        yield ending, context
        context.close()


def _save(png: bytes, path: Path) -> None:
    """Write a picture in a form that needs a fifth of the bytes."""
    from PIL import Image

    Image.open(io.BytesIO(png)).convert("RGB").save(path, quality=_QUALITY, method=6)
    print(path)


def _take_hints(page: Any, world: World, shoot: Shoot) -> None:
    page.wait_for_timeout(2500)  # the map comes after the first picture
    shoot("hints")


def _teach_first(browser: Any, world: World) -> None:
    context = new_context(browser, PHONE)
    page = open_page(context, world.address)
    page.locator("[data-mode=train]").tap()
    teach(world, Fingers(page), 350, near_m=0.6)
    page.locator("[data-mode=stopped]").tap()
    context.close()


def _take_drive(page: Any, world: World, shoot: Shoot) -> None:
    page.locator("[data-mode=train]").tap()
    fingers = Fingers(page)
    page.wait_for_selector("drive-pad:not(.idle)")
    teach(world, fingers, world.lessons + 30, near_m=0.6)
    fingers.press(pad("forward"))
    page.wait_for_timeout(400)
    shoot("teach")
    fingers.lift()
    page.locator("[data-mode=autonomous]").tap()
    page.wait_for_timeout(800)
    shoot("drive")
    page.locator("button.stop.shown").tap()
    page.wait_for_timeout(400)
    shoot("stop")
    page.locator(".notice button").tap()
    page.wait_for_selector(".notice button", state="hidden")
    page.locator("[data-mode=stopped]").tap()


def _take_screens(page: Any, world: World, shoot: Shoot) -> None:
    for screen in SCREENS:
        page.goto(f"{world.address}/#{screen}")
        page.wait_for_timeout(1200)
        shoot(screen)
    page.goto(f"{world.address}/#gallery")
    page.locator(".card").nth(2).tap()
    page.wait_for_timeout(800)
    shoot("image")
    page.goto(f"{world.address}/#home")
    page.locator("button[aria-label*='20']").first.tap()
    page.wait_for_selector(".timeline .you[d]")
    page.locator(".player").evaluate("element => element.scrollIntoView({block: 'start'})")
    page.wait_for_timeout(800)
    shoot("mend")
    page.goto(f"{world.address}/#drive")
    page.wait_for_timeout(2500)
    page.locator("app-bar [aria-controls=menu]").tap()
    page.wait_for_timeout(300)
    shoot("menu")


def _take_away(browser: Any, world: World, folder: Path) -> None:
    """The drive screen when the network fails while the robot drives."""
    for ending, context in _contexts(browser):
        proxy = BrokenWay(int(world.address.rsplit(":", 1)[1]))
        page = open_page(context, proxy.address)
        page.locator("[data-mode=autonomous]").tap()
        page.wait_for_timeout(500)
        proxy.fault = "silent"
        page.wait_for_timeout(4000)
        _save(page.screenshot(), folder / f"away-{ending}.webp")
        proxy.close()


def _take_pairing(browser: Any, folder: Path) -> None:
    """The screens of an unpaired phone."""
    with tempfile.TemporaryDirectory() as kept:
        config = NetworkConfig(port=0, web=WEB, lan=True, data=Path(kept))
        with live_server(config, pairing=Pairing(10)) as server:
            for ending, context in _contexts(browser):
                page = context.new_page()
                page.goto(f"{server.address}/pair")
                page.wait_for_timeout(300)
                _save(page.screenshot(), folder / f"pair-{ending}.webp")


def _take_class(browser: Any, folder: Path) -> None:
    """The teacher's board with pictures, with codes, and with a STOP that missed one robot."""
    for ending, context in _contexts(browser):
        with (
            tempfile.TemporaryDirectory() as kept,
            running_class(Path(kept), 6, 1, simulated=True) as world,
        ):
            page = context.new_page()

            def shoot(name: str, page: Any = page, ending: str = ending) -> None:
                page.wait_for_timeout(800)
                _save(page.screenshot(), folder / f"{name}-{ending}.webp")

            page.goto(world.address)
            page.locator(".robot[data-status=there]").nth(5).wait_for()
            page.wait_for_timeout(1500)
            shoot("class")
            page.locator("[data-view=codes]").click()
            shoot("class-codes")
            page.locator("[data-view=pictures]").click()
            page.locator("[data-number='2'] .acts button").last.click()
            shoot("class-robot")
            page.locator("#panel .title button").click()
            page.locator("button.stop").click()
            page.locator("#loud p").wait_for()
            shoot("class-stop")


def _hold_trial(browser: Any, world: World) -> None:
    """Trial 1, at fifteen times the real speed."""
    conductor = conductor_of(world)
    conductor.pace = 15.0
    context = new_context(browser, PHONE)
    page = open_page(context, world.address)
    httpx.post(f"{world.address}/api/session", json={"trial": 1, "teach_s": 180})
    httpx.post(f"{world.address}/api/session/drive")
    session = conductor.session
    assert session is not None
    page.locator("[data-mode=train]").tap()
    fingers = Fingers(page)
    teach(world, fingers, 10_000, until=lambda: session.phase_index > 0)
    page.wait_for_timeout(500)
    drive_on(page, world, until=lambda: session.phase_index > 1)
    page.wait_for_timeout(500)
    drive_on(page, world, until=lambda: session.step is SessionStep.QUESTIONS)
    answers = {"answers": {"closing": 6}, "done": True}
    httpx.post(f"{world.address}/api/session/answers", json=answers).raise_for_status()
    context.close()


def _take_result(page: Any, world: World, shoot: Shoot) -> None:
    page.goto(f"{world.address}/#study")
    page.locator("study-screen .curve.robot").first.wait_for(state="attached")
    page.wait_for_timeout(1500)
    page.locator("study-screen .lead").first.scroll_into_view_if_needed()
    shoot("result")


def _take_participants(browser: Any, folder: Path) -> None:
    """The screens of a study with participants: the researcher's list, and a participant's
    screens."""
    with passing_world("box") as world:
        conductor = conductor_of(world)
        conductor.pace = 200.0

        def post(path: str, **body: Any) -> None:
            httpx.post(f"{world.address}/api/{path}", json=body).raise_for_status()

        def take(name: str) -> None:
            _each(
                browser,
                world,
                folder,
                lambda page, world, shoot: _take_study_screen(page, shoot, name),
            )

        post("studies", name="walk", plan=PLAN)
        post("session", study="walk", participant="P01")
        take("study-consent")
        post("session/consent", language="en")
        take("study-part")
        post("session/drive")
        _drive_phases(browser, world, conductor)
        take("study-questions")
        httpx.delete(f"{world.address}/api/session").raise_for_status()
        take("study")


def _take_study_screen(page: Any, shoot: Shoot, name: str) -> None:
    page.evaluate("location.hash = 'study'")
    page.locator("study-screen button, study-screen a.button").first.wait_for()
    page.wait_for_timeout(500)
    shoot(name)


def _drive_phases(browser: Any, world: World, conductor: Conductor) -> None:
    """Choose the mode of each phase, until the questions are shown."""
    context = new_context(browser, PHONE)
    page = open_page(context, world.address)
    while (session := conductor.session) is not None and (phase := session.phase) is not None:
        choose(page, world, phase.mode)
        page.wait_for_timeout(200)
    context.close()


PARTS: dict[str, Callable[[Any, Path], None]] = {
    "office": _take_office,
    "pairing": _take_pairing,
    "class": _take_class,
    "film": take_film,
    "study": _take_trial,
    "participants": _take_participants,
}
"""The sets of pictures that can be taken separately: python -m tests.e2e.screenshots FOLDER office
class."""


if __name__ == "__main__":
    take_all(Path(sys.argv[1]), sys.argv[2:])
