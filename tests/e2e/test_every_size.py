"""No text is truncated and nothing overlaps, on every screen, at every size and in every language.

The drive screen has a test of its own (test_holds_still.py). `make test` measures each size in one
of three languages; at full size each is measured in all of them. The language `longer` is invented:
English, but half as long again.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from robot.challenge.tries import Ending, Try
from server.challenge.extension import ChallengeExtension
from server.services import Services
from tests.kit.sizes import IS_FULL

from .boxes import MEASURE, faults, in_language, sized
from .class_world import LiveClass, running_class
from .recordings import drive
from .world import World, finish_recording, open_page, running_world, settle, show

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
LANGUAGES = ("en", "es", "zh", "longer") if IS_FULL else ("es", "zh", "longer")
SCREENS = ("gallery", "why", "teaching", "undo", "challenge", "study", "home", "settings")


def everywhere(
    page: Any, language: str, what: str, found: Callable[[Any], list[str]] = faults
) -> list[str]:
    """Return the faults of the current screen, at each size."""
    first = 0 if IS_FULL else LANGUAGES.index(language)
    sizes = SIZES[first :: 1 if IS_FULL else len(LANGUAGES)]
    named = sized(page, [(size, 100) for size in sizes])
    return [f"{what} {size}: {fault}" for size in named for fault in found(page)]


@pytest.fixture(scope="module")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """A robot that was taught a little, with a recording; the tests of this file change nothing."""
    folder = tmp_path_factory.mktemp("taught")
    with running_world(folder, world="office", frame_rate_hz=30.0) as running:
        drive(running, 60)
        finish_recording(running)
    with running_world(folder, world="office", frame_rate_hz=3.0) as running:
        have_tried(running.services)
        yield running


def have_tried(robot: Services) -> None:
    """Give a robot a challenge's result, and show it on the board."""
    challenge = robot.extension(ChallengeExtension).challenge
    challenge.tries = (Try(3.08, 60.0, Ending.TIME), Try(1.92, 31.0, Ending.BUMPED))
    challenge.best_m, challenge.is_shown = 3.08, True
    robot.show()


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_text_is_truncated_and_no_elements_overlap(
    chromium: Any, taught: World, language: str
) -> None:
    context = in_language(chromium, language)
    page = open_page(context, taught.address)
    page.locator("app-bar [aria-controls=menu]").click()
    wrong = everywhere(page, language, "drive, with the menu")
    for screen in SCREENS:
        show(page, screen)
        _open_all(page)
        wrong += everywhere(page, language, screen)
    context.close()
    assert wrong == []


def _open_all(page: Any) -> None:
    """Open all collapsed parts, such as the details of a card or the tools of a recording."""
    for opener in ("[aria-expanded=false].quiet", ".gallery .card"):
        shown = page.locator(f"#other {opener}")
        for i in range(min(shown.count(), 3) - 1, -1, -1):
            shown.nth(i).click(timeout=40_000)
            settle(page)


@pytest.fixture(scope="module")
def school(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveClass]:
    """A class in which one robot does not answer, and one has a long name."""
    with running_class(tmp_path_factory.mktemp("class"), 3, 1) as running:
        running.robots[0].identity.change(name="Wolkenkuckucksheim Wagen")
        for robot in running.robots:
            have_tried(robot)
        yield running


_MOVED = """async () => {
  const { Card } = await import('./board/card.js');
  const there = {
    status: 'there', name: 'Ada', colour: 'green', detail: '', invitations: 1, driven_by: null,
    lessons: 10, agreement: null, battery: null, busy: false, link: 'good', delay_ms: null,
    address: 'http://192.168.1.20:8000', stop: null, fault: null, asks_pilot: false, locks: [],
    emergency: false, stop_held_by: null,
  };
  const changes = [
    {}, { lessons: 0 }, { driven_by: 'pilot' }, { driven_by: 'robot' }, { asks_pilot: true },
    { emergency: true }, { stop_held_by: 'teacher' }, { stop: 'asked' }, { stop: 'not_reached' },
    { agreement: 0.97, delay_ms: 23 }, { agreement: 1, battery: 0.8, link: 'slow', delay_ms: 4321 },
    { agreement: 1, battery: 0.8, busy: true, delay_ms: 4321 },
    { fault: 'the camera sends nothing: check its plug, or the address of its stream' },
    ...['away', 'not_ours', 'no_class', 'connecting'].map((status) => (
      { status, detail: '[Errno 113] No route to host at robot-7.local:8000 (tried for 20 s)' })),
  ];
  const acts = { stop() {}, release() {}, open() {} };
  const cards = Array.from({ length: 6 }, (_, i) => new Card(1000 + i, acts));
  document.getElementById('robots').replaceChildren(...cards.map(({ element }) => element));
  const loud = document.getElementById('loud');
  const places = () => [...document.querySelectorAll('.halt, #bar .stop.shown')]
    .map((button) => button.getBoundingClientRect().top);
  const found = [];
  for (const showsCodes of [false, true]) {
    document.body.dataset.view = showsCodes ? 'codes' : 'pictures';
    for (const card of cards) card.show(there, showsCodes);
    const before = places();
    for (const change of changes) {
      cards[0].show({ ...there, ...change }, showsCodes);
      loud.textContent = change.stop === 'not_reached' ? 'Not reached: Ada, Bolt' : '';
      const most = Math.max(...places().map((top, i) => Math.abs(top - before[i])));
      const view = document.body.dataset.view;
      if (most > 1) found.push(`${view} ${JSON.stringify(change)}: ${most} px`);
    }
    loud.textContent = '';
  }
  return found;
}"""
_IN_EACH_STATE = """async () => {
  const press = (selector) => document.querySelector(selector).click();
  // A panel at the side may reach up to the bar, and in a low window this is unavoidable.
  const onThePanel = () => innerHeight >= 480 && innerWidth < 700
    && document.querySelector('button.stop').getBoundingClientRect().bottom
       > document.querySelector('#panel .title').getBoundingClientRect().top;
  const found = [];
  for (const selector of ['[data-view=pictures]', '[data-view=codes]',
    '.robot .acts button:last-child', '#bar > button:not(.stop)']) {
    press(selector);
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
    const isOpen = !document.querySelector('#panel').hidden;
    for (const fault of (MEASURE)()) found.push(`${selector}: ${fault}`);
    if (isOpen && onThePanel()) found.push(`${selector}: STOP lies on the panel`);
    if (isOpen) press('#panel .title button');
  }
  return found;
}""".replace("MEASURE", MEASURE)
"""Lists the faults of both views and both panels at one size, because changing the size takes
longer than changing the view."""
_IN_EACH_LESSON = """async () => {
  const found = [];
  for (const part of ['teach-it', 'fool-it', 'fair-data']) {
    location.hash = part;
    while (!document.querySelector(`nav [href$=${part}][aria-current]`)) {
      await new Promise((done) => setTimeout(done, 5));
    }
    document.querySelector('#teacher').open = true;
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
    for (const fault of (MEASURE)()) found.push(`${part}: ${fault}`);
  }
  return found;
}""".replace("MEASURE", MEASURE)


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_board_has_room_everywhere_and_no_stop_moves(
    chromium: Any, school: LiveClass, language: str
) -> None:
    context = in_language(chromium, language)
    page = context.new_page()
    page.goto(school.address)
    page.locator(".robot .figures", has_text=re.compile("3[.,]1")).nth(2).wait_for()
    page.locator("button.stop").click()
    page.locator("#loud p").wait_for()
    page.locator(".robot .release:visible").nth(2).wait_for()
    page.locator("[data-view=codes]").click()
    page.locator(".robot .code").nth(2).wait_for()
    wrong = everywhere(page, language, "board", lambda page: faults(page, _IN_EACH_STATE))
    if language != "longer":
        wrong += everywhere(page, language, "STOP moves", lambda page: page.evaluate(_MOVED))
    page.goto(f"{school.address}/codes")
    page.locator("article .code").nth(2).wait_for()
    page.fill("#wifi", "Institut-Schule-WLAN-2.4-GHz")
    page.locator("#wifi").blur()
    page.locator("article li", has_text="2.4-GHz").nth(2).wait_for()
    wrong += everywhere(page, language, "cards", _faults_of_a_document)
    page.goto(f"{school.address}/lesson#teach-it")
    page.locator("nav [aria-current]").wait_for()
    wrong += everywhere(
        page, language, "lesson", lambda page: _faults_of_a_document(page, _IN_EACH_LESSON)
    )
    context.close()
    assert not wrong, "\n".join(wrong)


def _faults_of_a_document(page: Any, measure: str = MEASURE) -> list[str]:
    """Return the layout faults of a page that scrolls as a whole and cannot drive a robot."""
    return faults(page, measure, ("STOP is not on the screen", "below the window"))
