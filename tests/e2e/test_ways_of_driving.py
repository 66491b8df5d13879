"""Each way of driving drives the simulated robot; each way of letting go stops it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from robot.types import Action, Mode

from .hand import (
    Fingers,
    choose,
    drive_on,
    hold_until,
    pad,
    press_until,
    turned_rad,
    turning,
    wait_until_standing,
)
from .world import (
    LANDSCAPE,
    World,
    release_stop,
    wait_for,
)

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture
def world(rover: World) -> World:
    return rover


@pytest.fixture
def phone(rovers_phone: Any) -> Any:
    return rovers_phone


@pytest.fixture
def desktop(rovers_desktop: Any) -> Any:
    return rovers_desktop


def test_touch_slides_from_one_direction_to_another(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", turning(world))
    assert turned_rad(world) > 0.02
    fingers.slide(pad("right"))
    wait_for(lambda: world.action is Action.RIGHT, "the finger slid to the right")
    assert turned_rad(world) < -0.02
    fingers.lift()
    wait_until_standing(world)


def test_two_fingers_are_one_direction(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "forward", lambda: world.action is Action.FORWARD)
    fingers.press(pad("left"), finger=2)
    wait_for(lambda: world.action is Action.LEFT, "the newer finger counts")
    fingers.lift(finger=2)
    wait_for(lambda: world.action is Action.FORWARD, "the older one is still there")
    fingers.lift(finger=1)
    wait_for(lambda: world.action is Action.STOP, "nothing is held")
    assert phone.evaluate("visualViewport.scale") == 1, "two fingers do not zoom"


def test_the_mouse_drives(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    desktop.locator(pad("left")).hover()
    press_until(desktop, world, desktop.mouse.down, desktop.mouse.up, turning(world))
    desktop.mouse.up()
    wait_until_standing(world)


@pytest.mark.parametrize(
    ("key", "action"),
    [("ArrowLeft", Action.LEFT), ("d", Action.RIGHT), ("w", Action.FORWARD)],
)
def test_keys_drive_while_held(desktop: Any, world: World, key: str, action: Action) -> None:
    choose(desktop, world, Mode.TRAIN)
    down, up = (partial(act, key) for act in (desktop.keyboard.down, desktop.keyboard.up))
    press_until(desktop, world, down, up, lambda: world.action is action)
    desktop.keyboard.up(key)
    wait_for(lambda: world.action is Action.STOP, f"{key} let go")


def test_enter_holds_a_focused_button_and_space_stops(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    desktop.locator(pad("left")).focus()
    down, up = (partial(act, "Enter") for act in (desktop.keyboard.down, desktop.keyboard.up))
    press_until(desktop, world, down, up, turning(world))
    desktop.keyboard.press("Space")
    wait_for(lambda: world.rig.loop.state.emergency, "space stops it")
    wait_until_standing(world)
    desktop.keyboard.up("Enter")


def test_space_stops_from_every_screen(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    for screen in ("gallery", "teaching", "undo", "home", "settings"):
        desktop.evaluate(f"location.hash = '{screen}'")
        desktop.wait_for_selector(f"{screen}-screen")
        assert desktop.locator("app-bar .stop").is_visible()
        desktop.keyboard.press("Space")
        wait_for(lambda: world.rig.loop.state.emergency, f"space stops on {screen}")
        release_stop(desktop, world)


LETTING_GO: dict[str, Callable[[Any, Fingers], None]] = {
    "the finger is lifted": lambda page, fingers: fingers.lift(),
    "the touch is cancelled": lambda page, fingers: fingers.cancel(),
    "the window loses the focus": lambda page, fingers: page.evaluate(
        "void dispatchEvent(new Event('blur'))"
    ),
    "another page is opened": lambda page, fingers: page.goto("about:blank"),
    "the page is reloaded": lambda page, fingers: page.reload(),
    "another screen is opened": lambda page, fingers: page.evaluate("location.hash = 'home'"),
}


@pytest.mark.parametrize("name", LETTING_GO)
def test_letting_go_stops(phone: Any, world: World, name: str) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", turning(world))
    LETTING_GO[name](phone, fingers)
    wait_until_standing(world)


def test_a_hidden_page_stops_even_what_drives_itself(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    wanted = world.lessons + 20
    hold_until(world, fingers, "left", lambda: world.lessons > wanted)
    fingers.lift()
    choose(phone, world, Mode.AUTONOMOUS)
    drive_on(phone, world, until=turning(world))
    phone.evaluate(
        """() => {
          Object.defineProperty(document, 'hidden', {get: () => true, configurable: true});
          document.dispatchEvent(new Event('visibilitychange'));
        }"""
    )
    wait_until_standing(world)
    assert "out of sight" in phone.locator(".notice").inner_text()
    phone.reload()  # it is in sight again


def test_turning_the_phone_while_holding_stops_or_goes_on_never_sticks(
    phone: Any, world: World
) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", turning(world))
    phone.set_viewport_size(LANDSCAPE)
    phone.wait_for_timeout(300)
    boxes = [phone.locator(pad(m)).bounding_box() for m in ("left", "right", "forward")]
    assert boxes[0]["x"] + boxes[0]["width"] < LANDSCAPE["width"] / 3, "turns: left thumb"
    assert boxes[2]["x"] > LANDSCAPE["width"] * 2 / 3, "forward: right thumb"
    fingers.lift()
    wait_until_standing(world)
    hold_until(world, fingers, "right", lambda: world.action is Action.RIGHT)
    fingers.lift()


def test_arrows_move_between_modes_and_drive_nothing_and_space_keeps_the_focus(
    desktop: Any, world: World
) -> None:
    focused = "document.activeElement.dataset.mode"
    desktop.locator("mode-bar [data-mode=train]").focus()
    desktop.keyboard.press("Enter")
    wait_for(lambda: world.mode is Mode.TRAIN, "Enter chooses")
    desktop.keyboard.down("ArrowRight")
    assert desktop.evaluate(focused) == "autonomous"
    desktop.wait_for_timeout(300)
    assert (world.mode, world.action) == (Mode.TRAIN, Action.STOP)
    desktop.keyboard.up("ArrowRight")
    desktop.keyboard.press("Space")
    wait_for(lambda: world.rig.loop.state.emergency, "space stops wherever the focus is")
    desktop.wait_for_selector("mode-bar [data-mode=train][aria-disabled=true]")
    assert desktop.evaluate(focused) == "autonomous", "the focus stays"


def test_what_is_ready_is_celebrated_once_and_what_is_to_be_pressed_is_lit(phone: Any) -> None:
    phone.evaluate(
        """() => {
          window.notes = 0;
          const { createOscillator } = AudioContext.prototype;
          AudioContext.prototype.createOscillator = function () {
            window.notes += 1;
            return createOscillator.call(this);
          };
          const { page } = document.querySelector('app-bar');
          page.follow = () => {};
          window.tell = (mode, stage) => page.store.set({
            robot: { ...page.store.state.robot, mode, lessons: 300, stop_reason: null,
              taught: { forward: 200, left: 90, right: 90 } },
            readiness: { stage, alone_s: 0, alone_needed_s: 45, unknown_share: 0, missing: [] },
          });
        }"""
    )
    for stage, lit in (("teach", 0), ("try", 1), ("ready", 1)):
        phone.evaluate(f"tell('train', '{stage}')")
        assert phone.locator("mode-bar [data-mode=autonomous].lit").count() == lit, stage
    phone.evaluate("tell('autonomous', 'try')")
    assert phone.locator(".lit, .joy").count() == 0
    for _ in range(3):
        phone.evaluate("tell('autonomous', 'ready')")
    assert phone.locator("teach-panel.joy.ready").count() == 1
    assert phone.evaluate("notes") == 3
    phone.evaluate("tell('autonomous', 'try')")
    phone.evaluate("document.querySelector('app-bar').page.preferences.set('sound', false)")
    phone.evaluate("tell('autonomous', 'ready')")
    assert phone.evaluate("notes") == 3, "muted"
