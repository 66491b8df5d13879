"""Ways of driving that need separate pages, and therefore separate robots.

The last request of a closed page, such as STOP, may reach its robot late: in the next test, if both
tests used the same robot.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from robot.simulator.driver import SimDriver
from robot.types import Action, Mode, StopReason
from tests.kit.wait import wait_until

from .boxes import drive_faults
from .hand import Fingers, choose, hold_until, pad, turning
from .world import (
    DESKTOP,
    LANDSCAPE,
    PHONE,
    World,
    new_context,
    open_page,
    wait_until_free,
)

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def test_a_second_tab_watches_asks_and_takes_over_politely(
    chromium: Any, phone: Any, world: World
) -> None:
    context = chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    second = open_page(context, world.address)
    second.locator(".notice", has_text="Somebody else has the wheel").wait_for()
    assert second.locator("[data-mode=train]").is_disabled()
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", turning(world))
    others = Fingers(second)
    others.press(pad("forward"))
    second.wait_for_timeout(300)
    assert world.action is not Action.FORWARD, "who watches cannot drive"
    others.lift()
    second.locator(".notice button").tap()
    phone.locator(".notice button", has_text="Hand over the wheel").wait_for()
    reason = world.rig.loop.state.decision.stop_reason
    is_slow = reason in (StopReason.LINK_SLOW, StopReason.FRAME_STALE)
    assert world.action is Action.LEFT or is_slow, "asking stops nobody"
    fingers.lift()
    phone.locator(".notice button").tap()
    wait_until_free(second)
    second.locator(".notice", has_text="You have the wheel now").wait_for()
    assert world.mode is Mode.STOPPED, "a change of hands stops the robot"
    second.locator("drive-pad .stop").tap()
    wait_until(lambda: world.rig.loop.state.emergency, "anybody may stop it")
    context.close()


def test_the_map_moves_no_button_when_it_comes_and_leaves_the_pad_its_place(
    chromium: Any, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The map is fetched after the first picture, when a hand may be on its way to the pad."""
    context = new_context(chromium, DESKTOP)
    on_its_way: list[Any] = []
    context.route("**/*-screens.js", lambda route: on_its_way.append(route))
    page = open_page(context, world.address)
    wait_until(lambda: page.evaluate("true") and on_its_way, "the map is asked for")
    places = (
        "[...document.querySelectorAll('drive-pad button')].map(b => b.getBoundingClientRect())"
    )
    before = page.evaluate(places)
    on_its_way[0].continue_()
    page.locator("drive-map .body").first.wait_for(state="attached")
    assert page.evaluate(places) == before

    height = "document.querySelector('drive-pad').getBoundingClientRect().height"
    beside_the_map = page.evaluate(height)
    sense = SimDriver.sense
    monkeypatch.setattr(SimDriver, "sense", lambda self: replace(sense(self), pose=None))
    page.locator("drive-map").wait_for(state="hidden")
    assert page.evaluate(height) > beside_the_map + 100
    assert drive_faults(page) == []
    context.close()


WRONGLY_HIT = """(n) => {
  const moves = Array.from({ length: n }, (_, i) => `wave_${i}`);
  const { page } = document.querySelector('app-bar');
  page.follow = () => {};
  const rest = { icon: '', does: '', steering: null, throttle: null };
  page.greet({ role: 'pilot', robot: 'Rover', moves, declared_moves: moves.map((name, i) => (
    { name, label: { en: `Wave with both hands ${i}` }, ...rest })) });
  const buttons = [...document.querySelectorAll('drive-pad .move')];
  return buttons.flatMap((button) => {
    const { left, top, width, height } = button.getBoundingClientRect();
    return [0.2, 0.5, 0.8]
      .flatMap((u) => [0.05, 0.5, 0.95].map((v) => [left + u * width, top + v * height]))
      .filter(([x, y]) => document.elementFromPoint(x, y)?.closest('.move, .stop') !== button)
      .map(() => button.textContent);
  });
}"""


def test_no_label_of_a_move_lies_over_another_move(phone: Any) -> None:
    """A finger on it would drive that robot."""
    for size in (PHONE, LANDSCAPE, {"width": 320, "height": 568}):
        phone.set_viewport_size(size)
        for moves in (5, 12):
            assert phone.evaluate(WRONGLY_HIT, moves) == [], (size, moves)
