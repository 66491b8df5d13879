"""STOP works on every screen of the page and with any finger, and nothing covers it."""

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

COVERINGS = """async (text) => {
  const drawn = () => new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)));
  const visible = (selector) => [...document.querySelectorAll(selector)]
    .filter((e) => e.checkVisibility({ visibilityProperty: true }));
  const stopFault = () => {
    const stops = visible('.stop');
    if (stops.length !== 1) return `${stops.length} STOP buttons`;
    const { left, right, top, bottom, width, height } = stops[0].getBoundingClientRect();
    if (width < 44 || height < 44) return `STOP is ${width}x${height}`;
    // A rounded corner is not the button's for the eye either.
    const corners = [left + 5, right - 5].flatMap((x) => [top + 5, bottom - 5].map((y) => [x, y]));
    for (const [x, y] of [[(left + right) / 2, (top + bottom) / 2], ...corners])
      if (!stops[0].contains(document.elementFromPoint(x, y))) return `STOP is covered at ${x}`;
    if (stops[0].showPopover && !stops[0].matches(':popover-open')) return 'not in the top layer';
    return '';
  };
  const underTheToast = () => {
    const toasts = visible('toast-bar, .notice');
    if (toasts.length !== 1) return `${toasts.length} toasts`;
    const a = toasts[0].getBoundingClientRect();
    return visible('button, a, input, select').filter((e) => !toasts[0].contains(e)).filter((e) => {
      const b = e.getBoundingClientRect();
      const scroller = e.closest('#other, .drive')?.getBoundingClientRect();
      const top = Math.max(b.top, scroller?.top ?? 0);
      const bottom = Math.min(b.bottom, scroller?.bottom ?? innerHeight);
      const isBeside = a.left >= b.right - 1 || b.left >= a.right - 1;
      return bottom > top && !isBeside && a.top < bottom - 1 && top < a.bottom - 1;
    }).map((e) => e.outerHTML.slice(0, 90)).join();
  };
  const wrong = [];
  const check = (what, fault) => { if (fault) wrong.push(`${what}: ${fault}`); };
  const { page } = document.querySelector('toast-bar');
  await drawn();
  check('alone', stopFault());
  page.toast(text, { label: 'Undo', act: () => {} });
  await drawn();
  check('with a toast', stopFault());
  check('under the toast', underTheToast());
  document.querySelector('app-bar [aria-controls=menu]').click();
  if (!visible('#menu').length) wrong.push('no menu');
  check('with toast and menu', stopFault());
  document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', bubbles: true }));
  if (visible('#menu').length) wrong.push('the menu stays');
  page.store.set({ toast: null });
  const dialog = document.createElement('dialog');
  dialog.style.cssText = 'width: 100vw; height: 100vh; overflow: hidden';
  document.body.append(dialog);
  dialog.popover = 'manual';
  dialog.showPopover();
  for (let i = 0; i < 50 && stopFault(); i += 1) await drawn(); // STOP comes on top again
  check('with a dialog over all of it', stopFault());
  dialog.remove();
  return wrong;
}"""
"""A script that covers the screen with each possible element in turn, and returns the failures."""


@pytest.fixture(scope="module")
def untouched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    """A robot that nobody drives or stops, so that no other message hides a toast."""
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
            faults = page.evaluate(COVERINGS, TOAST)
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
        # the next page has this setting, too
        steer_by(page, "stick" if "stick" in name else "moves")
        if "slides" in name:
            choose(page, rover, Mode.TRAIN)
        WAYS[name](page, fingers)
        wait_until(lambda: rover.rig.loop.state.emergency, name)
        if is_touch:
            fingers.lift()


def test_stop_finds_its_way_without_a_websocket(rovers_phone: Any, rover: World) -> None:
    rovers_phone.evaluate("document.querySelector('drive-pad').page.connection.say = () => false")
    rovers_phone.locator("drive-pad .stop").tap()
    wait_until(lambda: rover.rig.loop.state.emergency, "the page sends STOP over HTTP")
    rovers_phone.reload()  # the page has a websocket again
