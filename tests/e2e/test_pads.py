"""Game pads on the page: an unknown layout is asked about, then drives; a button stops.

What each pad means is tested in Node (tests/web/pads.test.mjs).
"""

from __future__ import annotations

import contextlib
import json
from functools import partial
from typing import Any

import pytest

from robot.types import Action, Mode
from tests.kit.wait import wait_until

from .hand import choose, press_until
from .world import DESKTOP, World, new_context

pytestmark = [pytest.mark.browser, pytest.mark.slow]
PADS = """
  window.pads = [];
  window.reads = 0;
  navigator.getGamepads = () => { window.reads += 1; return window.pads; };
  window.plug = (index, id, mapping, axes, buttons) => {
    const lying = { pressed: false, touched: false, value: 0 };
    const all = Array.from({ length: buttons }, () => lying);
    window.pads[index] = { index, id, mapping, axes, connected: true, buttons: all };
    dispatchEvent(new Event('gamepadconnected'));
  };
  window.noticed = [];  // a notice may be gone before a busy machine looks
  new MutationObserver(() => {
    for (const one of document.querySelectorAll('.notice')) window.noticed.push(one.textContent);
  }).observe(document, { subtree: true, childList: true, characterData: true });
  window.axis = (index, axis, value) => {
    window.pads[index].axes = window.pads[index].axes.with(axis, value);
  };
"""


def plug(page: Any, index: int, name: str, mapping: str, axes: list[float], buttons: int) -> None:
    words = ", ".join(json.dumps(word) for word in (index, name, mapping, axes, buttons))
    page.evaluate(f"plug({words})")
    is_read(page)


def axis(page: Any, index: int, number: int, value: float) -> None:
    page.evaluate(f"axis({index}, {number}, {value})")
    is_read(page)


def is_read(page: Any) -> None:
    """Wait until the page has read its pads several times as they are now."""
    page.evaluate("window.reads = 0")
    page.wait_for_function("() => window.reads >= 6")


def wait_for(page: Any, world: World, text: str) -> None:
    """Wait until a notice has said a text; a stop of a busy machine is said in its place."""

    def is_said() -> bool:
        if world.mode is Mode.STOPPED:
            choose(page, world, Mode.TRAIN)
        return bool(page.evaluate("(text) => noticed.some((one) => one.includes(text))", text))

    wait_until(is_said, text)


def choosing(page: Any, world: World) -> bool:
    """Touch the wheel, and take the offer to show its directions; True once they are asked."""
    axis(page, 0, 0, 0.7)
    wait_for(page, world, "Old Wheel")
    axis(page, 0, 0, 0.0)
    with contextlib.suppress(Exception):  # the offer is gone again
        page.locator(".notice button", has_text="Show its directions").click(timeout=5000)
    return bool(page.evaluate("noticed.some((one) => /et go/.test(one))"))


def test_a_pad_of_an_unknown_layout_is_asked_and_drives_until_it_is_unplugged(
    chromium: Any, world: World
) -> None:
    page = new_context(chromium, DESKTOP, locale="en").new_page()
    page.add_init_script(PADS)
    page.goto(world.address)
    page.wait_for_selector("video-view[data-frames]", state="attached")
    choose(page, world, Mode.TRAIN)
    wheel = "Old Wheel (Vendor: 046d Product: c294)"
    plug(page, 0, wheel, "", [0.0, -1.0, 1.0], 4)  # its pedals rest at their ends
    assert world.action is Action.STOP and world.lessons == 0, "no hand has touched it"
    wait_until(lambda: choosing(page, world), "its directions are asked for")
    assert world.action is Action.STOP and world.lessons == 0, "it is not known which way that is"
    for number, rest, full, name in (
        (0, 0.0, -1.0, "Left"),
        (0, 0.0, 1.0, "Right"),
        (1, -1.0, 1.0, "Forward"),
    ):
        wait_for(page, world, f"push “{name}”")
        is_read(page)  # at rest, from where it is pushed
        axis(page, 0, number, full)
        axis(page, 0, number, rest)
    wait_for(page, world, "is ready")
    push, let_go = (partial(axis, page, 0, 1, way) for way in (1.0, -1.0))
    press_until(page, world, push, let_go, lambda: world.action is Action.FORWARD)
    page.evaluate("pads[0] = null")  # unplugged while it is held
    wait_until(lambda: world.action is Action.STOP, "it is let go of")
    plug(page, 1, "Xbox Controller (STANDARD GAMEPAD)", "standard", [0.0, 0.0, 0.0, 0.0], 17)
    down = "{ pressed: true, touched: true, value: 1 }"
    page.evaluate(f"pads[1].buttons = pads[1].buttons.with(1, {down})")
    wait_until(lambda: world.rig.loop.state.emergency, "its button stops")
    page.context.close()
