"""Each way of driving drives the simulated robot; each way of letting go stops it."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from robot.types import Action, Mode
from tests.kit.sizes import IS_FULL, size
from tests.kit.wait import wait_until

from .hand import (
    SET_HIDDEN,
    Fingers,
    Way,
    choose,
    drive_on,
    hold_left,
    hold_until,
    pad,
    press_until,
    steer_by,
    stick,
    turned_rad,
    turning,
    wait_until_standing,
)
from .world import LANDSCAPE, PHONE, World, release_stop

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture
def world(rover: World) -> World:
    return rover


@pytest.fixture
def phone(rovers_phone: Any) -> Any:
    steer_by(rovers_phone, "moves")
    return rovers_phone


@pytest.fixture
def desktop(rovers_desktop: Any) -> Any:
    return rovers_desktop


def test_a_finger_slides_and_two_fingers_are_one_direction(phone: Any, world: World) -> None:
    wait_until(lambda: _slides_without_a_stop(phone, world), "each finger counts", 240)
    assert phone.evaluate("visualViewport.scale") == 1, "two fingers do not zoom"


def _slides_without_a_stop(phone: Any, world: World) -> bool:
    """Return False if a busy machine stopped the robot in between, as a slow link does."""
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "forward", lambda: world.action is Action.FORWARD)

    def moves(action: Action) -> bool:
        wait_until(lambda: world.action is action or world.mode is Mode.STOPPED, str(action))
        return world.mode is not Mode.STOPPED

    fingers.slide(pad("right"))
    turns = moves(Action.RIGHT) and turned_rad(world) < -0.02
    fingers.press(pad("left"), finger=2)
    newer_counts = moves(Action.LEFT)
    fingers.lift(finger=2)
    older_is_there = moves(Action.RIGHT)
    fingers.lift(finger=1)
    wait_until(lambda: world.action is Action.STOP, "nothing is held")
    return turns and newer_counts and older_is_there


def test_a_mouse_lets_go_though_its_other_button_is_down(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    desktop.locator(pad("left")).hover()
    press_until(desktop, world, desktop.mouse.down, desktop.mouse.up, turning(world))
    desktop.mouse.down(button="right")
    desktop.mouse.up(button="left")
    wait_until_standing(world)
    assert world.mode is Mode.TRAIN
    desktop.mouse.up(button="right")


def test_enter_holds_a_focused_button_for_as_long_as_it_is_down(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    desktop.evaluate(
        """() => {
          const { page } = document.querySelector('app-bar');
          page.follow = () => {};  // a busy computer stops a robot
          window.changes = [];
          page.helm.addEventListener('held', () => changes.push(page.helm.held));
        }"""
    )
    desktop.locator(pad("left")).focus()
    for _ in range(5):  # as a keyboard repeats it
        desktop.keyboard.down("Enter")
        desktop.wait_for_timeout(40)
    desktop.keyboard.up("Enter")
    assert desktop.evaluate("changes") == ["left", None]
    desktop.reload()  # it follows the robot again


KEYBOARDS = Path(__file__).parents[1] / "web" / "keyboards.mjs"
PLAY = (Path(__file__).parent / "keyboard.js").read_text(encoding="utf-8")


def _histories(first: int, count: int) -> list[dict[str, Any]]:
    made = f"Array.from({{ length: {count} }}, (_, i) => historyOf({first} + i))"
    script = (
        f"import {{ historyOf }} from '{KEYBOARDS.as_uri()}'; console.log(JSON.stringify({made}))"
    )
    command = ["node", "--input-type=module", "--eval", script]
    ran = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return list(json.loads(ran.stdout))


PAGE_KEYS = size("PAGE_KEYS", 20, 500)


@pytest.mark.timeout(300 + PAGE_KEYS)
def test_no_generated_keyboard_drives_on_in_a_browser(desktop: Any, world: World) -> None:
    for first in range(1, PAGE_KEYS + 1, 100):
        histories = _histories(first, min(100, PAGE_KEYS + 1 - first))
        played = desktop.evaluate(PLAY, histories)
        assert played["wrong"] == []
        assert played["counts"]["stops"] and played["counts"]["driven"]
    desktop.reload()  # its robot answers again
    wait_until_standing(world)


def _a_call_comes(page: Any, fingers: Fingers) -> None:
    page.evaluate(SET_HIDDEN, True)
    fingers.cancel()


def _tap_mode(fingers: Fingers, mode: str) -> None:
    fingers.press(f"mode-bar [data-mode={mode}]", finger=2)
    fingers.lift(finger=2)


LETTING_GO: dict[str, tuple[str, Callable[[Any, Fingers], None]]] = {
    "the finger is lifted": ("pointerup", lambda page, fingers: fingers.lift()),
    "the touch is cancelled": ("pointercancel", lambda page, fingers: fingers.cancel()),
    "the finger slides off": (
        "pointermove",
        lambda page, fingers: fingers.slide("teach-panel"),
    ),
    "the window loses the focus": (
        "blur",
        lambda page, fingers: page.evaluate("void dispatchEvent(new Event('blur'))"),
    ),
    "a call comes": ("visibilitychange", _a_call_comes),
    "a second finger presses STOP": (
        "pointerdown",
        lambda page, fingers: fingers.press("drive-pad .stop", finger=2),
    ),
    "a second finger taps Stop": ("pointerup", lambda page, fingers: _tap_mode(fingers, "stopped")),
    "the screen turns": ("resize", lambda page, fingers: page.set_viewport_size(LANDSCAPE)),
    "another page is opened": ("", lambda page, fingers: page.goto("about:blank")),
    "the page is reloaded": ("", lambda page, fingers: page.reload()),
    "another screen is opened": (
        "hashchange",
        lambda page, fingers: page.evaluate("location.hash = 'home'"),
    ),
}
"""The ends of a hold, and the event in which the page reports each."""
NOTE_SAID = """() => {
  window.said = [];
  const { connection } = document.querySelector('app-bar').page;
  connection.send = (text) => {
    const { type, held } = JSON.parse(text);
    if (type === 'drive') window.said.push([held, window.event?.type ?? 'time']);
    return Object.getPrototypeOf(connection).send.call(connection, text);
  };
}"""


@pytest.mark.parametrize("by", ["moves", "stick"])
def test_every_way_of_letting_go_stops_the_robot(
    rovers_page: Callable[[dict[str, int]], Any], world: World, by: str
) -> None:
    """The page reports it while it handles the event itself. Later delays are due to the link, and
    from there the table of faults applies, in virtual time (tests/faults)."""
    phone = None
    for name in LETTING_GO if IS_FULL else list(LETTING_GO)[by == "stick" :: 2]:
        if phone is None:
            phone = rovers_page(PHONE)
            steer_by(phone, by)
        choose(phone, world, Mode.TRAIN)
        fingers = Fingers(phone)
        press = partial(hold_left, fingers, by)
        press_until(phone, world, press, fingers.lift, lambda: world.action is Action.LEFT)
        event, let_go = LETTING_GO[name]
        phone.evaluate(NOTE_SAID)
        let_go(phone, fingers)
        wait_until(lambda: world.action is Action.STOP, name)
        if not event:
            phone = None  # it was left
            continue
        said = phone.evaluate("said.filter(([held], i) => !held && (!i || said[i - 1][0]))")
        assert said == [[None, event]], f"{name}: let go of once, at once, and held no more"
        phone.evaluate(SET_HIDDEN, False)
        if not fingers.are_lifted:
            what_is_still_held_must_be_held_anew(phone, world, fingers, by, name)
    if phone is not None:
        steer_by(phone, "moves")


def what_is_still_held_must_be_held_anew(
    phone: Any, world: World, fingers: Fingers, by: str, name: str
) -> None:
    phone.evaluate("location.hash = 'drive'")
    if world.rig.loop.state.emergency:
        release_stop(phone, world)
        phone.wait_for_timeout(600)  # two presses of STOP within half a second count as one
    choose(phone, world, Mode.TRAIN)
    if "slides off" not in name:
        for at in ((0.1, 0.1), (0.0, 0.0), (-0.8, 0.1)):  # as a finger does that lies on
            fingers.slide(pad("left") if by == "moves" else stick(), at=at)
    phone.wait_for_timeout(200)
    assert phone.evaluate("said.at(-1)[0]") is None, f"{name}: it is held without a new touch"
    assert world.action is Action.STOP, name
    fingers.cancel()
    phone.set_viewport_size(PHONE)


def test_the_steering_of_a_stick_is_shown_over_the_picture_and_in_the_gallery(
    phone: Any, world: World
) -> None:
    steer_by(phone, "stick")
    choose(phone, world, Mode.TRAIN)
    fingers, wanted = Fingers(phone), world.lessons + 8

    def hold(at: Way, until: Callable[[], bool]) -> None:
        """Move the thumb there, and again after each stop of a busy machine."""

        def put() -> None:
            (fingers.press if fingers.are_lifted else fingers.slide)(stick(), at=at)

        press_until(phone, world, put, fingers.lift, until)

    shown = phone.locator("video-view .needle[aria-label*='taught -4'] [class^=at-]:visible")
    hold((-0.5, 0.7), lambda: world.lessons > wanted and shown.count() >= 2)
    turns = {(-0.5, 0.7): Action.LEFT, (0.5, 0.7): Action.RIGHT, (0.3, 0.9): Action.RIGHT}
    for way, action in (turns | {(0.0, 0.9): Action.FORWARD}).items():
        hold(way, lambda w=way, a=action: near(world, w[0]) and world.action is a)
    hold((1.5, 0.4), lambda: near(world, 1.0))  # over the edge it is held to its end
    fingers.slide(stick(), at=(0.02, 0.0))
    wait_until(lambda: world.action is Action.STOP, "a thumb that rests drives nowhere")
    hold((0.0, 0.9), lambda: world.action is Action.FORWARD)
    fingers.lift()
    wait_until_standing(world)
    phone.evaluate("location.hash = 'gallery'")
    phone.locator(".card .needle[aria-label*='taught -']").first.wait_for()


def near(world: World, steering: float) -> bool:
    """True if the robot is driven about this far to one side."""
    point = world.rig.loop.state.decision.point
    return point is not None and abs(point.steering - steering) < 0.25


def test_each_thumb_has_its_moves_or_a_stick_when_the_phone_lies_on_its_side(
    phone: Any, world: World
) -> None:
    phone.set_viewport_size(LANDSCAPE)
    phone.wait_for_function(f"() => innerWidth === {LANDSCAPE['width']}")
    left, forward = (phone.locator(pad(move)).bounding_box() for move in ("left", "forward"))
    assert left["x"] + left["width"] < LANDSCAPE["width"] / 3, "turns: left thumb"
    assert forward["x"] > LANDSCAPE["width"] * 2 / 3, "forward: right thumb"
    steer_by(phone, "stick")
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    for side in ("left", "right"):
        box = phone.locator(stick(side)).bounding_box()
        middle = (box["x"] + box["width"] / 2) / LANDSCAPE["width"]
        assert middle < 0.3 if side == "left" else middle > 0.7
        press = partial(fingers.press, stick(side), at=(0.7, 0.5))
        press_until(phone, world, press, fingers.lift, lambda: near(world, 0.7))
        fingers.lift()
        wait_until(lambda: world.action is Action.STOP, f"the {side} thumb lets go")
    steer_by(phone, "moves")


def test_modes_are_chosen_while_another_finger_holds(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    wanted = world.lessons + 8
    hold_until(world, fingers, "left", lambda: world.lessons > wanted)
    _tap_mode(fingers, "autonomous")
    wait_until(lambda: world.mode is Mode.AUTONOMOUS, "it drives itself")
    fingers.press("mode-bar [data-mode=stopped]", finger=2)
    fingers.slide("video-view", finger=2)
    fingers.lift(finger=2)
    phone.wait_for_timeout(300)
    assert world.mode is not Mode.STOPPED, "a finger that slides off a button does not tap it"
    fingers.lift()


def test_a_finger_that_slides_off_the_pad_lets_go_though_another_tilts(
    phone: Any, world: World
) -> None:
    tilt = """(isOn) => {
      const { page } = document.querySelector('app-bar');
      page.preferences.values.tilt = isOn;
      page.store.set({ moves: [...page.store.state.moves] });
    }"""
    phone.evaluate(tilt, True)
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)

    def press() -> None:
        fingers.press(".move.tilt", finger=2)
        fingers.press(pad("left"))

    def lift() -> None:
        fingers.lift()
        fingers.lift(finger=2)

    press_until(phone, world, press, lift, turning(world))
    fingers.slide("video-view")
    wait_until_standing(world)
    assert phone.evaluate("document.querySelector('app-bar').page.helm.held") is None
    lift()
    phone.evaluate(tilt, False)


def test_a_robot_that_drives_itself_stops_when_its_page_is_hidden(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    wanted = world.lessons + 8
    hold_until(world, fingers, "left", lambda: world.lessons > wanted)
    fingers.lift()
    choose(phone, world, Mode.AUTONOMOUS)
    phone.evaluate("location.hash = 'settings'")
    wait_until(lambda: world.mode is Mode.STOPPED, "the robot stops")
    phone.evaluate("location.hash = 'drive'")
    phone.locator(".notice", has_text="you opened another screen").wait_for()
    choose(phone, world, Mode.AUTONOMOUS)
    drive_on(phone, world, until=turning(world))
    phone.evaluate(SET_HIDDEN, True)
    wait_until_standing(world)
    assert "out of sight" in phone.locator(".notice").inner_text()
    phone.reload()  # it is in sight again


def test_arrows_move_between_modes_and_drive_nothing_and_space_keeps_the_focus(
    desktop: Any, world: World
) -> None:
    focused = "document.activeElement.dataset.mode"
    desktop.locator("mode-bar [data-mode=train]").focus()
    desktop.keyboard.press("Enter")
    wait_until(lambda: world.mode is Mode.TRAIN, "Enter chooses")
    desktop.keyboard.down("ArrowRight")
    assert desktop.evaluate(focused) == "autonomous"
    desktop.wait_for_timeout(300)
    assert (world.mode, world.action) == (Mode.TRAIN, Action.STOP)
    desktop.keyboard.up("ArrowRight")
    desktop.keyboard.press("Space")
    wait_until(lambda: world.rig.loop.state.emergency, "space stops wherever the focus is")
    desktop.wait_for_selector("mode-bar [data-mode=train][aria-disabled=true]")
    assert desktop.evaluate(focused) == "autonomous", "the focus stays"
