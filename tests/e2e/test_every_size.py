"""Every screen at every size and in every language: nothing is truncated, nothing overlaps.

With DRIVELESSON_SIZES=all each screen is measured at the whole grid of test_holds_still.py, with
text from 100 to 200 %; each language takes another part of the grid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robot.challenge.tries import Ending, Try
from server.challenge.extension import ChallengeExtension
from server.services import Services
from tests.kit.sizes import IS_FULL

from .boxes import drive_faults, faults, speak_longer
from .recordings import drive
from .test_holds_still import GRID, IS_WHOLE, TEXT
from .world import World, finish_recording, open_page, running_world, settle, show

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SIZES = [
    (280, 653),  # a foldable phone, closed
    (320, 225),  # 400 % zoom of 1280x900
    (320, 480),
    (360, 225),
    (360, 640),
    (390, 844),
    (480, 320),
    (653, 280),
    (844, 390),
    (768, 1024),
    (1024, 600),
    (1280, 800),
    (1920, 1080),
    (3840, 2160),
]
LANGUAGES = ("en", "es", "zh", "longer")
_LET_IT_BACK = """() => {
  const { store } = document.querySelector('video-view').page;
  const { moves } = store.state;
  store.set({ moves: [...moves, 'backward'] });
  return moves;
}"""
SCREENS = ("gallery", "why", "teaching", "undo", "challenge", "study", "home", "settings")


@pytest.fixture(scope="module")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """A recorded robot that was taught a little; the pages here only show it."""
    folder = tmp_path_factory.mktemp("taught")
    with running_world(folder, world="office", frame_rate_hz=30.0) as running:
        drive(running, 60)
        finish_recording(running)
    with running_world(folder, world="office", frame_rate_hz=3.0) as running:
        have_tried(running.services)
        yield running


@pytest.mark.parametrize("language", LANGUAGES)
def test_nothing_is_cut_and_nothing_overlaps(chromium: Any, taught: World, language: str) -> None:
    locale = "en" if language == "longer" else language
    context = chromium.new_context(locale=locale, has_touch=True, service_workers="block")
    if language == "longer":
        speak_longer(context)
    page = open_page(context, taught.address)
    assert page.evaluate("document.documentElement.lang") == locale
    wrong = everywhere(page, language, "drive", drive_faults)
    if language != "longer":
        moves = page.evaluate(_LET_IT_BACK)
        wrong += everywhere(page, language, "drive with Back", drive_faults)
        page.evaluate(
            "(moves) => document.querySelector('video-view').page.store.set({ moves })", moves
        )
    page.locator("app-bar [aria-controls=menu]").click()
    wrong += everywhere(page, language, "menu")
    for screen in SCREENS:
        show(page, screen)
        _open_all(page)
        wrong += everywhere(page, language, screen)
    context.close()
    assert wrong == []


_SAY_IN_TURN = """async (language) => {
  const rooms = ['', 'components/screens/', 'study/session/', 'challenge/tries/'];
  const files = rooms.map((room) => import(`/js/${room}messages/${language}.js`));
  const words = Object.assign({}, ...(await Promise.all(files)).map((file) => file.default));
  const moves = Object.keys(words).filter((key) => key.startsWith('moves.'));
  const place = document.querySelector('.advice');
  const pad = document.querySelector('.move[data-move=forward]');
  const found = {};
  const isSaid = /^(advice|session.now_|challenge.(armed|left))/;
  for (const key of Object.keys(words).filter((key) => isSaid.test(key))) {
    for (const move of words[key].includes('{moves}') ? moves : ['']) {
      const values = { moves: words[move], left: 120, have: 123, need: 150, n: 10, of: 12 };
      values.metres = '12.3';
      place.textContent = words[key].replace(/\\{(\\w+)\\}/g, (_, name) => values[name]);
      (found[pad.getBoundingClientRect().top] ??= []).push(place.textContent);
    }
  }
  return found;
}"""


@pytest.mark.parametrize("language", ["en", "es", "zh"])
def test_no_advice_moves_the_pad_under_the_hand(
    chromium: Any, taught: World, language: str
) -> None:
    context = chromium.new_context(locale=language, has_touch=True, service_workers="block")
    page = open_page(context, taught.address)
    for size in _sizes(page, language):
        if int(size.split("x")[0]) < 360 or not size.endswith(" 100 %"):
            continue  # a foldable phone, closed, zoom or large text: a sentence may need two lines
        places = page.evaluate(_SAY_IN_TURN, language)
        assert len(places) == 1, f"{size}: {places}"
    context.close()


def have_tried(robot: Services) -> None:
    """Give a robot a challenge's result, and show it on the board."""
    challenge = robot.extension(ChallengeExtension).challenge
    challenge.tries = (Try(3.08, 60.0, Ending.TIME), Try(1.92, 31.0, Ending.BUMPED))
    challenge.best_m, challenge.is_shown = 3.08, True
    robot.show()


def everywhere(
    page: Any, language: str, what: str, found: Callable[[Any], list[str]] = faults
) -> list[str]:
    """Return the faults of the current screen, at each size."""
    sizes = _sizes(page, language)
    return [f"{what} {size}: {fault}" for size in sizes for fault in found(page)]


def _sizes(page: Any, language: str) -> Any:
    """Yield all sizes in CI, and otherwise the sizes that belong to this language."""
    devtools = page.context.new_cdp_session(page)
    first = LANGUAGES.index(language)
    part = slice(first, None, len(LANGUAGES))
    sizes = GRID[part] if IS_WHOLE else SIZES if IS_FULL else SIZES[part]
    for i, (width, height) in enumerate(sizes):
        text = TEXT[i % len(TEXT)] if IS_WHOLE else 100
        page.evaluate(f"document.documentElement.style.fontSize = '{text}%'")
        size = {"width": width, "height": height, "screenWidth": width, "screenHeight": height}
        devtools.send(
            "Emulation.setDeviceMetricsOverride", {**size, "deviceScaleFactor": 1, "mobile": False}
        )
        yield f"{width}x{height} {text} %"
    devtools.detach()


def _open_all(page: Any) -> None:
    """Open everything that a touch opens: a card's detail, the tools of a model or recording."""
    for opener in ("[aria-expanded=false].quiet", ".gallery .card"):
        shown = page.locator(f"#other {opener}")
        for i in range(min(shown.count(), 3) - 1, -1, -1):
            shown.nth(i).click(timeout=40_000)
            settle(page)
