"""Game pads on the page: it asks about an unknown layout, and the most recently used pad drives."""

from __future__ import annotations

import json
from typing import Any

import pytest

from robot.types import Action, Mode
from tests.kit.wait import wait_until

from .hand import choose
from .world import DESKTOP, World, new_context

pytestmark = [pytest.mark.browser, pytest.mark.slow]
PADS = """
  window.pads = [];
  navigator.getGamepads = () => window.pads;
  window.plug = (index, id, mapping, axes, buttons) => {
    const lying = { pressed: false, touched: false, value: 0 };
    const all = Array.from({ length: buttons }, () => lying);
    window.pads[index] = { index, id, mapping, axes, connected: true, buttons: all };
    dispatchEvent(new Event('gamepadconnected'));
  };
  window.unplug = (index) => { window.pads[index] = null; };
  window.axis = (index, axis, value) => {
    window.pads[index].axes = window.pads[index].axes.with(axis, value);
  };
"""


def plug(page: Any, index: int, name: str, mapping: str, axes: list[float], buttons: int) -> None:
    words = ", ".join(json.dumps(word) for word in (index, name, mapping, axes, buttons))
    page.evaluate(f"plug({words})")


def axis(page: Any, index: int, number: int, value: float) -> None:
    page.evaluate(f"axis({index}, {number}, {value})")
    page.wait_for_timeout(100)


def wait_for(page: Any, text: str) -> None:
    page.locator(".notice", has_text=text).wait_for()


def drives(world: World, action: Action) -> None:
    wait_until(lambda: world.action is action, f"the robot goes {action}")


def test_a_pad_of_an_unknown_layout_is_asked_and_of_two_the_newest_drives(
    chromium: Any, world: World, tmp_path: Any
) -> None:
    page = new_context(chromium, DESKTOP, locale="en").new_page()
    page.add_init_script(PADS)
    page.goto(world.address)
    page.wait_for_selector("video-view[data-frames]", state="attached")
    choose(page, world, Mode.TRAIN)
    wheel = "Old Wheel (Vendor: 046d Product: c294)"
    plug(page, 0, wheel, "", [0.0, -1.0, 1.0], 4)  # its pedals rest at their ends
    page.wait_for_timeout(1000)
    assert world.action is Action.STOP and world.lessons == 0, "no hand has touched it"
    axis(page, 0, 0, 0.7)
    wait_for(page, "Old Wheel")
    page.screenshot(path=tmp_path / "pad-offered.png")
    assert world.action is Action.STOP, "it is not known which way that is"
    axis(page, 0, 0, 0.0)
    page.locator(".notice button").click()
    for number, rest, full, name in (
        (0, 0.0, -1.0, "left"),
        (0, 0.0, 1.0, "right"),
        (1, -1.0, 1.0, "forward"),
    ):
        wait_until(
            lambda name=name: name in page.locator(".notice").inner_text().lower(),  # type: ignore[misc]
            f"{name} is asked for",
        )
        page.screenshot(path=tmp_path / f"pad-asked-{name}.png")
        axis(page, 0, number, full)
        page.wait_for_timeout(200)
        axis(page, 0, number, rest)
        page.wait_for_timeout(600)
    while page.locator(".notice button", has_text="skip").count():
        page.locator(".notice button").click()
    axis(page, 0, 1, 1.0)
    drives(world, Action.FORWARD)
    plug(page, 1, "Xbox Controller (STANDARD GAMEPAD)", "standard", [0.0, 0.0, 0.0, 0.0], 17)
    page.wait_for_timeout(200)
    axis(page, 1, 0, -1.0)
    drives(world, Action.LEFT)
    wait_for(page, "Xbox Controller")
    page.screenshot(path=tmp_path / "pad-used.png")
    axis(page, 0, 1, -1.0)
    page.evaluate("unplug(1)")  # while it is held
    drives(world, Action.STOP)
    page.reload()
    page.wait_for_selector("video-view[data-frames]", state="attached")
    choose(page, world, Mode.TRAIN)
    plug(page, 0, wheel, "", [0.0, -1.0, 1.0], 4)
    page.wait_for_timeout(300)
    axis(page, 0, 0, -1.0)
    drives(world, Action.LEFT)
    page.context.close()
