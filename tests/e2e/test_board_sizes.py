"""The board of a class at every size: nothing is cut, and no STOP moves under a hand."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from tests.kit.sizes import few

from .boxes import MEASURE, faults, speak_longer
from .class_world import LiveClass, running_class
from .test_every_size import LANGUAGES, everywhere, have_tried

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SIZES = [
    (280, 653),
    (320, 225),
    (360, 640),
    (390, 844),
    (653, 360),
    (768, 1024),
    (844, 390),
    (1280, 800),
]
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


@pytest.fixture(scope="module")
def school(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveClass]:
    """A class in which one robot does not answer, and one has a long name."""
    with running_class(tmp_path_factory.mktemp("class"), 3, 1) as running:
        running.robots[0].identity.change(name="Wolkenkuckucksheim Wagen")
        yield running


@pytest.fixture(params=few(["es", "en", "zh"], 1))
def board(chromium: Any, school: LiveClass, request: pytest.FixtureRequest) -> Iterator[Any]:
    """The board's page, in one language on a touch screen."""
    context = chromium.new_context(locale=request.param, has_touch=True)
    page = context.new_page()
    page.goto(school.address)
    page.locator("#bar .stop.shown").wait_for()
    yield page
    context.close()


def test_no_stop_moves_whatever_a_robot_says(board: Any) -> None:
    wrong = []
    for width, height in SIZES:
        board.set_viewport_size({"width": width, "height": height})
        wrong += [f"{width}x{height}: {fault}" for fault in board.evaluate(_MOVED)]
    assert not wrong, "\n".join(wrong)


def test_on_every_tablet_stop_all_stands_in_the_first_row(board: Any) -> None:
    for width in range(600, 1300, 20):
        board.set_viewport_size({"width": width, "height": 900})
        board.wait_for_function("() => new Promise((done) => requestAnimationFrame(() => done(1)))")
        top = board.locator("#bar .stop.shown").bounding_box()["y"]
        assert top < 20, f"{width} wide: {top}"


_HEIGHTS = """() => {
  const heights = () => [...document.querySelectorAll('.robot')].map((card) => card.offsetHeight);
  const shown = [...document.querySelectorAll('.release')].filter((button) => !button.hidden);
  const held = heights();
  for (const button of shown) button.hidden = true;
  const free = heights();
  for (const button of shown) button.hidden = false;
  return [held, free];
}"""
"""The cards' heights with and without the buttons that release a robot, measured at one moment,
because a robot's message may come at any time and stretch the neighbouring cards."""
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
"""Lists the faults of both views and both panels at one size: a new size costs more than these."""
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
def test_the_board_of_a_class_has_room_everywhere(
    chromium: Any, school: LiveClass, language: str
) -> None:
    locale = "en" if language == "longer" else language
    context = chromium.new_context(locale=locale, has_touch=True)
    if language == "longer":
        speak_longer(context)
    page = context.new_page()
    for robot in school.robots:
        have_tried(robot)
    page.goto(school.address)
    page.locator(".robot .figures", has_text=re.compile("3[.,]1")).nth(2).wait_for()
    rule = page.locator(".robot .figures").first.evaluate("e => getComputedStyle(e).borderTopWidth")
    assert rule == "0px", "what the menu's figures look like is not what a card's do"
    page.locator("button.stop").click()
    page.locator("#loud p").wait_for()
    page.locator(".robot .release:visible").nth(2).wait_for()
    held, free = page.evaluate(_HEIGHTS)
    assert held == free, "STOP below them has moved under the hand"
    page.locator("[data-view=codes]").click()
    page.locator(".robot .code").nth(2).wait_for()
    wrong = everywhere(page, language, "board", lambda page: faults(page, _IN_EACH_STATE))
    page.goto(f"{school.address}/codes")
    page.locator("article .code").nth(2).wait_for()
    page.fill("#wifi", "Institut-Schule-WLAN-2.4-GHz")
    page.locator("#wifi").blur()
    page.locator("article li", has_text="2.4-GHz").nth(2).wait_for()
    wrong += everywhere(page, language, "cards", faults_without_stop)
    page.goto(f"{school.address}/lesson#teach-it")
    page.locator("nav [aria-current]").wait_for()
    wrong += everywhere(page, language, "lesson", lambda p: faults_without_stop(p, _IN_EACH_LESSON))
    context.close()
    assert not wrong, "\n".join(wrong)


def faults_without_stop(page: Any, measure: str = MEASURE) -> list[str]:
    """Return the faults of a document: it commands no robot, and scrolls as a whole."""
    return faults(page, measure, ("STOP is not on the screen", "below the window"))
