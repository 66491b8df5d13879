"""What was let go of, in whatever way, is held only when it is pressed anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from robot.types import Mode

from .hand import (
    Fingers,
    choose,
    hold_until,
    pad,
    press_until,
    steer_by,
    turning,
    wait_until_standing,
)
from .world import LANDSCAPE, World, release_stop, wait_for

pytestmark = [pytest.mark.browser, pytest.mark.slow]

BLUR = "void dispatchEvent(new Event('blur'))"


@pytest.fixture
def world(rover: World) -> World:
    return rover


@pytest.fixture
def phone(rovers_phone: Any) -> Any:
    steer_by(rovers_phone, "moves")
    return rovers_phone


@pytest.fixture
def desktop(rovers_desktop: Any) -> Any:
    steer_by(rovers_desktop, "moves")
    return rovers_desktop


def _stop(page: Any, fingers: Fingers) -> None:
    fingers.press("drive-pad .stop", finger=2)
    fingers.lift(finger=2)
    page.wait_for_selector("mode-bar [data-mode=train][aria-disabled=true]")


TAKEN: dict[str, Callable[[Any, Fingers], object]] = {
    "the window loses the focus": lambda page, fingers: page.evaluate(BLUR),
    "another finger presses STOP": _stop,
    "another finger taps Stop": lambda page, fingers: _tap_mode(fingers, "stopped"),
    "the screen turns": lambda page, fingers: page.set_viewport_size(LANDSCAPE),
}


@pytest.mark.parametrize("how", TAKEN)
def test_a_finger_that_lies_on_and_trembles_does_not_drive_again(
    phone: Any, world: World, how: str
) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", turning(world))
    TAKEN[how](phone, fingers)
    wait_until_standing(world)
    release_stop(phone, world)
    if world.mode is Mode.STOPPED:
        page = "document.querySelector('app-bar').page"
        phone.evaluate(f"{page}.choose('train')")  # a finger on the glass takes the place of a tap
        wait_for(lambda: world.mode is Mode.TRAIN, "taught again")
    for away in (0.1, 0.0, 0.1):
        fingers.slide(pad("left"), at=(away, away))
    wait_until_standing(world)
    assert phone.evaluate("document.querySelector('app-bar').page.helm.held") is None
    fingers.lift()
    hold_until(world, fingers, "left", turning(world))
    fingers.lift()


def _tap_mode(fingers: Fingers, mode: str) -> None:
    fingers.press(f"mode-bar [data-mode={mode}]", finger=2)
    fingers.lift(finger=2)


def test_modes_are_chosen_while_another_finger_holds(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    wanted = world.lessons + 20
    hold_until(world, fingers, "left", lambda: world.lessons > wanted)
    _tap_mode(fingers, "autonomous")
    wait_for(lambda: world.mode is Mode.AUTONOMOUS, "it drives itself")
    fingers.press("mode-bar [data-mode=stopped]", finger=2)
    fingers.slide("video-view", finger=2)
    fingers.lift(finger=2)
    phone.wait_for_timeout(300)
    assert world.mode is not Mode.STOPPED, "a finger that slides off a button does not tap it"
    _tap_mode(fingers, "stopped")
    wait_for(lambda: world.mode is Mode.STOPPED, "Stop stops")
    fingers.lift()


def test_a_mouse_lets_go_though_its_other_button_is_down(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    desktop.locator(pad("left")).hover()
    press_until(desktop, world, desktop.mouse.down, desktop.mouse.up, turning(world))
    desktop.mouse.down(button="right")
    desktop.mouse.up(button="left")
    wait_until_standing(world)
    assert world.mode is Mode.TRAIN
    desktop.mouse.up(button="right")


def test_a_key_is_let_go_of_when_a_mac_will_not_tell(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    press_until(
        desktop,
        world,
        lambda: desktop.keyboard.down("ArrowLeft"),
        lambda: desktop.keyboard.up("ArrowLeft"),
        turning(world),
    )
    desktop.keyboard.down("Meta")
    wait_until_standing(world)
    assert world.mode is Mode.TRAIN
    desktop.keyboard.up("Meta")
    desktop.keyboard.up("ArrowLeft")


def test_enter_holds_a_button_for_as_long_as_it_is_down(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    desktop.locator(pad("left")).focus()
    changes = """() => {
      window.changes = [];
      const { helm } = document.querySelector('app-bar').page;
      helm.addEventListener('held', () => window.changes.push(helm.held));
    }"""
    desktop.evaluate(changes)
    for _ in range(30):  # as a keyboard repeats it
        desktop.keyboard.down("Enter")
        desktop.wait_for_timeout(40)
    assert desktop.evaluate("changes") == ["left"]
    desktop.keyboard.up("Enter")
    wait_until_standing(world)
    desktop.wait_for_timeout(600)
    assert desktop.evaluate("changes") == ["left", None]
