"""An input that was released, in any way, counts as held only after it is pressed again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from robot.types import Mode
from tests.kit.wait import wait_until

from .hand import (
    Fingers,
    choose,
    hold_until,
    pad,
    press_until,
    turning,
    wait_until_standing,
)
from .world import LANDSCAPE, World, release_stop

pytestmark = [pytest.mark.browser, pytest.mark.slow]

BLUR = "void dispatchEvent(new Event('blur'))"


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
    rovers_phone: Any, rover: World, how: str
) -> None:
    choose(rovers_phone, rover, Mode.TRAIN)
    fingers = Fingers(rovers_phone)
    hold_until(rover, fingers, "left", turning(rover))
    TAKEN[how](rovers_phone, fingers)
    wait_until_standing(rover)
    release_stop(rovers_phone, rover)
    if rover.mode is Mode.STOPPED:
        page = "document.querySelector('app-bar').page"
        # A finger on the glass replaces a tap.
        rovers_phone.evaluate(f"{page}.choose('train')")
        wait_until(lambda: rover.mode is Mode.TRAIN, "taught again")
    for away in (0.1, 0.0, 0.1):
        fingers.slide(pad("left"), at=(away, away))
    wait_until_standing(rover)
    assert rovers_phone.evaluate("document.querySelector('app-bar').page.helm.held") is None
    fingers.lift()
    hold_until(rover, fingers, "left", turning(rover))
    fingers.lift()


def _tap_mode(fingers: Fingers, mode: str) -> None:
    fingers.press(f"mode-bar [data-mode={mode}]", finger=2)
    fingers.lift(finger=2)


def test_modes_are_chosen_while_another_finger_holds(rovers_phone: Any, rover: World) -> None:
    choose(rovers_phone, rover, Mode.TRAIN)
    fingers = Fingers(rovers_phone)
    wanted = rover.lessons + 8
    hold_until(rover, fingers, "left", lambda: rover.lessons > wanted)
    _tap_mode(fingers, "autonomous")
    wait_until(lambda: rover.mode is Mode.AUTONOMOUS, "it drives itself")
    fingers.press("mode-bar [data-mode=stopped]", finger=2)
    fingers.slide("video-view", finger=2)
    fingers.lift(finger=2)
    rovers_phone.wait_for_timeout(300)
    assert rover.mode is not Mode.STOPPED, "a finger that slides off a button does not tap it"
    _tap_mode(fingers, "stopped")
    wait_until(lambda: rover.mode is Mode.STOPPED, "Stop stops")
    fingers.lift()


def test_a_mouse_lets_go_though_its_other_button_is_down(rovers_desktop: Any, rover: World) -> None:
    choose(rovers_desktop, rover, Mode.TRAIN)
    rovers_desktop.locator(pad("left")).hover()
    press_until(
        rovers_desktop, rover, rovers_desktop.mouse.down, rovers_desktop.mouse.up, turning(rover)
    )
    rovers_desktop.mouse.down(button="right")
    rovers_desktop.mouse.up(button="left")
    wait_until_standing(rover)
    assert rover.mode is Mode.TRAIN
    rovers_desktop.mouse.up(button="right")


def test_a_key_is_let_go_of_when_a_mac_will_not_tell(rovers_desktop: Any, rover: World) -> None:
    choose(rovers_desktop, rover, Mode.TRAIN)
    press_until(
        rovers_desktop,
        rover,
        lambda: rovers_desktop.keyboard.down("ArrowLeft"),
        lambda: rovers_desktop.keyboard.up("ArrowLeft"),
        turning(rover),
    )
    rovers_desktop.keyboard.down("Meta")
    wait_until_standing(rover)
    assert rover.mode is Mode.TRAIN
    rovers_desktop.keyboard.up("Meta")
    rovers_desktop.keyboard.up("ArrowLeft")


def test_enter_holds_a_button_for_as_long_as_it_is_down(rovers_desktop: Any, rover: World) -> None:
    note = """() => {
      const { helm, store } = document.querySelector('app-bar').page;
      helm.addEventListener('held', () => window.changes?.push(helm.held));
      store.watch(['link', 'robot'], ({ link, robot }) => (
        window.isStopped ||= link !== 'open' || robot?.mode !== 'train'));
    }"""
    rovers_desktop.evaluate(note)
    for _ in range(20):
        choose(rovers_desktop, rover, Mode.TRAIN)
        rovers_desktop.locator(pad("left")).focus()
        rovers_desktop.evaluate("Object.assign(window, { changes: [], isStopped: false })")
        for _ in range(30):  # as a keyboard repeats it
            rovers_desktop.keyboard.down("Enter")
            rovers_desktop.wait_for_timeout(40)
        held = rovers_desktop.evaluate("changes")
        rovers_desktop.keyboard.up("Enter")
        wait_until_standing(rover)
        rovers_desktop.wait_for_timeout(600)
        if not rovers_desktop.evaluate("isStopped"):  # a busy computer stops a robot, rightly
            break
    else:
        pytest.fail("it was stopped each time")
    assert held == ["left"]
    assert rovers_desktop.evaluate("changes") == ["left", None]


def test_a_finger_that_slides_off_the_pad_lets_go_though_another_tilts(
    rovers_phone: Any, rover: World
) -> None:
    tilt = """(isOn) => {
      const { page } = document.querySelector('app-bar');
      page.preferences.values.tilt = isOn;
      page.store.set({ moves: [...page.store.state.moves] });
    }"""
    rovers_phone.evaluate(tilt, True)
    choose(rovers_phone, rover, Mode.TRAIN)
    fingers = Fingers(rovers_phone)

    def press() -> None:
        fingers.press(".move.tilt", finger=2)
        fingers.press(pad("left"))

    def lift() -> None:
        fingers.lift()
        fingers.lift(finger=2)

    press_until(rovers_phone, rover, press, lift, turning(rover))
    fingers.slide("video-view")
    wait_until_standing(rover)
    assert rovers_phone.evaluate("document.querySelector('app-bar').page.helm.held") is None
    lift()
    rovers_phone.evaluate(tilt, False)
