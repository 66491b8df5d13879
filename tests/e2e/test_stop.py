"""STOP cannot be covered or missed: on every screen, in every form, under every finger."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from robot.types import Mode
from server.config import Config
from tests.kit.sizes import few
from tests.kit.wait import wait_until

from .hand import Fingers, choose, hold_left, steer_by
from .world import DESKTOP, LANDSCAPE, PHONE, World, new_context, open_page, running_world

pytestmark = [pytest.mark.browser, pytest.mark.slow]


SCREENS = ("drive", "gallery", "teaching", "undo", "home", "settings")
SIZES = {
    "phone": PHONE,
    "small phone": {"width": 360, "height": 640},
    "landscape": LANDSCAPE,
    "small landscape": {"width": 640, "height": 360},
    "magnified": {"width": 360, "height": 225},
    "desktop": DESKTOP,
}
TOAST = "It was relabelled, and this sentence is as long as any that a toast has to say here."

HITS = """() => {
  const stop = [...document.querySelectorAll('.stop')].filter((e) => e.checkVisibility());
  if (stop.length !== 1) return `${stop.length} stop buttons`;
  const box = stop[0].getBoundingClientRect();
  if (box.width < 44 || box.height < 44) return `${box.width}x${box.height}`;
  const corner = 5;  // a rounded corner is not the button's for the eye either
  const points = [[box.left + box.width / 2, box.top + box.height / 2]];
  for (const x of [box.left + corner, box.right - corner])
    for (const y of [box.top + corner, box.bottom - corner]) points.push([x, y]);
  const missed = points.filter(([x, y]) => {
    const hit = document.elementFromPoint(x, y);
    return !(hit && stop[0].contains(hit));
  });
  if (missed.length) return `missed at ${JSON.stringify(missed)}, box ${JSON.stringify(box)}`;
  if (stop[0].showPopover && !stop[0].matches(':popover-open')) return 'not in the top layer';
  return '';
}"""

COVERED = """() => {
  const toasts = [...document.querySelectorAll('toast-bar, .notice')]
    .filter((e) => e.checkVisibility());
  if (toasts.length !== 1) return `${toasts.length} toasts`;
  const a = toasts[0].getBoundingClientRect();
  return [...document.querySelectorAll('button, a, input, select')]
    .filter((e) => e.checkVisibility({ visibilityProperty: true }) && !toasts[0].contains(e))
    .filter((e) => {
      const b = e.getBoundingClientRect();
      if (b.bottom <= 0 || b.top >= innerHeight || !b.width) return false;
      const scroller = e.closest('#other, .drive')?.getBoundingClientRect();
      const top = Math.max(b.top, scroller?.top ?? 0);
      const bottom = Math.min(b.bottom, scroller?.bottom ?? innerHeight);
      const isBeside = a.left >= b.right - 1 || b.left >= a.right - 1;
      return !isBeside && a.top < bottom - 1 && top < a.bottom - 1;
    })
    .map((e) => e.outerHTML.slice(0, 90));
}"""


COVERINGS = (
    f"async ([text, label]) => {{ const HITS = {HITS}; const COVERED = {COVERED};"
    """
  const drawn = () => new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)));
  const { page } = document.querySelector('toast-bar');
  const opener = document.querySelector('app-bar [aria-controls=menu]');
  const wrong = [];
  const check = (what, fault) => { if (fault.length) wrong.push(`${what}: ${fault}`); };
  await drawn();
  check('alone', HITS());
  page.toast(text, { label, act: () => {} });
  await drawn();
  check('with a toast', HITS());
  check('with a toast', COVERED());
  opener.click();
  if (!document.querySelector('#menu').checkVisibility()) wrong.push('no menu');
  check('with toast and menu', HITS());
  document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', bubbles: true }));
  if (document.querySelector('#menu').checkVisibility()) wrong.push('the menu stays');
  page.store.set({ toast: null });
  const dialog = document.createElement('dialog');
  dialog.textContent = 'x'.repeat(9000);
  dialog.style.cssText = 'width: 100vw; height: 100vh; overflow: hidden';
  document.body.append(dialog);
  dialog.popover = 'manual';
  dialog.showPopover();
  for (let frames = 0; frames < 50 && HITS(); frames += 1) await drawn(); // STOP comes on top again
  check('with a dialog over all of it', HITS());
  dialog.remove();
  return wrong;
}"""
)
"""Covers the screen with everything possible, one after the other, and reports the effects on
STOP."""


@pytest.fixture(scope="module")
def untouched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """A robot that nobody drives or stops, so that no message of its own covers a toast."""
    with running_world(tmp_path_factory.mktemp("untouched"), world="office") as running:
        yield running


@pytest.mark.parametrize("language", few(["es", "en", "zh"], 1))
def test_nothing_covers_stop_and_no_toast_covers_a_control(
    chromium: Any, untouched: World, language: str
) -> None:
    context = new_context(chromium, DESKTOP, locale=language, has_touch=True)
    page = open_page(context, untouched.address)
    wrong = []
    for screen in SCREENS:
        page.evaluate(f"location.hash = '{screen}'")
        if screen != "drive":
            page.wait_for_selector(f"{screen}-screen")
        for form, size in SIZES.items():
            page.set_viewport_size(size)
            faults = page.evaluate(COVERINGS, [TOAST, "Undo"])
            wrong += [f"{screen} on a {form}, {fault}" for fault in faults]
    context.close()
    assert wrong == []


def test_no_dialog_makes_the_rest_of_the_page_inert() -> None:
    sources = list(Config().web.rglob("*.js"))
    assert sources
    assert [file.name for file in sources if "showModal" in file.read_text()] == []


def _slide_from_a_direction(page: Any, fingers: Fingers, by: str) -> None:
    hold_left(fingers, by)
    fingers.slide("drive-pad .stop")


def _scroll_another_screen(page: Any, fingers: Fingers) -> None:
    page.evaluate("location.hash = 'settings'")
    page.wait_for_selector("settings-screen")
    page.wait_for_timeout(200)
    fingers.press("settings-screen")
    fingers.slide("app-bar h1")
    fingers.slide("app-bar .stop")


def _press_enter(page: Any, _: Fingers) -> None:
    page.locator("drive-pad .stop").focus()
    page.keyboard.press("Enter")


WAYS: dict[str, Callable[[Any, Fingers], object]] = {
    "a tap, before the finger is lifted": lambda page, fingers: fingers.press("drive-pad .stop"),
    "a finger that slides from a move": partial(_slide_from_a_direction, by="moves"),
    "a finger that slides from the stick": partial(_slide_from_a_direction, by="stick"),
    "a finger that scrolls another screen": _scroll_another_screen,
    "a mouse": lambda page, fingers: page.locator("drive-pad .stop").click(),
    "a keyboard": _press_enter,
    "an assistant": lambda page, fingers: page.locator("drive-pad .stop").dispatch_event("click"),
}


@pytest.mark.parametrize("viewport", [PHONE, DESKTOP], ids=["touch", "mouse and keys"])
def test_stop_is_pressed_in_every_way(
    rovers_page: Callable[[dict[str, int]], Any], rover: World, viewport: dict[str, int]
) -> None:
    is_touch = viewport is PHONE
    for name in list(WAYS)[:4] if is_touch else list(WAYS)[4:]:
        page = rovers_page(viewport)
        fingers = Fingers(page)
        steer_by(page, "stick" if "stick" in name else "moves")  # for the next page, too
        if "slides" in name:
            choose(page, rover, Mode.TRAIN)
        WAYS[name](page, fingers)
        wait_until(lambda: rover.rig.loop.state.emergency, name)
        if is_touch:
            fingers.lift()


def test_stop_finds_its_way_without_a_websocket(rovers_phone: Any, rover: World) -> None:
    rovers_phone.evaluate("document.querySelector('drive-pad').page.connection.say = () => false")
    rovers_phone.locator("drive-pad .stop").tap()
    wait_until(lambda: rover.rig.loop.state.emergency, "it asks over HTTP")
    rovers_phone.reload()  # it has a websocket again
