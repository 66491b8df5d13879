"""Each kind of input drives the simulated robot, and each kind of release stops it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from robot.types import Action, Mode
from tests.kit.sizes import IS_FULL
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
    wait_until(lambda: _slides_without_a_stop(phone, world), "the newest finger counts", 240)
    assert phone.evaluate("visualViewport.scale") == 1, "two fingers do not zoom"


def _slides_without_a_stop(phone: Any, world: World) -> bool:
    """Slide a finger and press a second one; return False if a busy machine stopped the robot."""
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


def test_a_mouse_lets_go_although_its_other_button_is_down(desktop: Any, world: World) -> None:
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
    desktop.locator(pad("left")).focus()
    down, up = (partial(key, "Enter") for key in (desktop.keyboard.down, desktop.keyboard.up))
    press_until(desktop, world, down, up, lambda: world.action is Action.LEFT)
    desktop.evaluate(NOTE_SAID)
    # otherwise a busy machine could stop the robot
    desktop.evaluate("document.querySelector('app-bar').page.follow = () => {}")
    for _ in range(4):  # like a keyboard that repeats the key
        down()
        desktop.wait_for_timeout(40)
    up()
    wait_until(lambda: world.action is Action.STOP, "the key is released")
    said = desktop.evaluate("said.filter(([held]) => !held)")
    assert said[0] == [None, "keyup"], "the move is held from the first press to the release"
    desktop.reload()  # the page shows its usual text


def _a_call_comes(page: Any, fingers: Fingers) -> None:
    page.evaluate(SET_HIDDEN, True)
    fingers.cancel()


def _tap_mode(fingers: Fingers, mode: str) -> None:
    fingers.press(f"mode-bar [data-mode={mode}]", finger=2)
    fingers.lift(finger=2)


LETTING_GO: dict[str, tuple[str, Callable[[Any, Fingers], None]]] = {
    "the finger is lifted": ("pointerup", lambda page, fingers: fingers.lift()),
    "the touch is cancelled": ("pointercancel", lambda page, fingers: fingers.cancel()),
    "the finger slides off": ("pointermove", lambda page, fingers: fingers.slide("teach-panel")),
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
"""The ways in which a hold ends, each with the event in which the page reports it."""
OWN = ("the finger is lifted", "the touch is cancelled", "the screen turns")
"""The ends of a hold that buttons and the stick handle themselves; the page handles the others."""
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
    """The page reports a release while it handles the event itself. Later delays are due to the
    link; tests/faults checks them in virtual time."""
    phone = None
    others = [name for name in LETTING_GO if name not in OWN]
    for name in LETTING_GO if IS_FULL else [*OWN, *others[by == "stick" :: 2]]:
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
            phone = None  # the next way needs a new page
            continue
        said = phone.evaluate("said.filter(([held], i) => !held && (!i || said[i - 1][0]))")
        assert said == [[None, event]], f"{name}: the page lets go once and holds no more"
        phone.evaluate(SET_HIDDEN, False)
        if not fingers.are_lifted:
            a_held_input_needs_a_new_touch(phone, world, fingers, by, name)
    if phone is not None:
        steer_by(phone, "moves")


def a_held_input_needs_a_new_touch(
    phone: Any, world: World, fingers: Fingers, by: str, name: str
) -> None:
    phone.evaluate("location.hash = 'drive'")
    if world.rig.loop.state.emergency:
        release_stop(phone, world)
        phone.wait_for_timeout(600)  # two presses of STOP within half a second count as one
    choose(phone, world, Mode.TRAIN)
    if "slides off" not in name:
        for at in ((0.1, 0.1), (0.0, 0.0), (-0.8, 0.1)):  # a finger rests on the button
            fingers.slide(pad("left") if by == "moves" else stick(), at=at)
    phone.wait_for_timeout(200)
    assert phone.evaluate("said.at(-1)[0]") is None, f"{name}: held without a new touch"
    assert world.action is Action.STOP, name
    fingers.cancel()
    phone.set_viewport_size(PHONE)


def test_a_stick_steers_as_far_as_it_is_pushed_and_the_picture_shows_it(
    phone: Any, world: World
) -> None:
    steer_by(phone, "stick")
    choose(phone, world, Mode.TRAIN)
    fingers, wanted = Fingers(phone), world.lessons + 8

    def hold(at: Way, until: Callable[[], bool]) -> None:
        """Move the thumb there, and again after each stop that a busy machine causes."""

        def put() -> None:
            (fingers.press if fingers.are_lifted else fingers.slide)(stick(), at=at)

        press_until(phone, world, put, fingers.lift, until)

    shown = phone.locator("video-view .needle[aria-label*='taught -4'] [class^=at-]:visible")
    hold((-0.5, 0.7), lambda: world.lessons > wanted and shown.count() >= 2)
    for way, action in {(0.3, 0.9): Action.RIGHT, (0.0, 0.9): Action.FORWARD}.items():
        hold(way, lambda w=way, a=action: near(world, w[0]) and world.action is a)
    hold((1.5, 0.4), lambda: near(world, 1.0))  # beyond the edge, the stick stays at its end
    fingers.slide(stick(), at=(0.02, 0.0))
    wait_until(lambda: world.action is Action.STOP, "a resting thumb stops the robot")
    fingers.lift()


def near(world: World, steering: float) -> bool:
    """True if the pilot steers the robot about this far to one side."""
    point = world.rig.loop.state.decision.point
    return point is not None and abs(point.steering - steering) < 0.25


def test_on_a_phone_on_its_side_each_thumb_has_its_moves_or_a_stick(
    phone: Any,
) -> None:
    width = LANDSCAPE["width"]
    phone.set_viewport_size(LANDSCAPE)
    phone.wait_for_function(f"() => innerWidth === {width}")

    def middle(selector: str) -> float:
        box = phone.locator(selector).bounding_box()
        return float(box["x"] + box["width"] / 2) / width

    assert middle(pad("left")) < 1 / 3 and middle(pad("forward")) > 2 / 3
    steer_by(phone, "stick")
    assert middle(stick("left")) < 0.3 and middle(stick("right")) > 0.7
    steer_by(phone, "moves")


PADS = """() => {
  window.pads = [];
  navigator.getGamepads = () => window.pads;
  const button = (isDown) => ({ pressed: isDown, touched: isDown, value: Number(isDown) });
  window.plug = (index, axes, down) => {
    const buttons = Array.from({ length: 17 }, (_, i) => button(i === down));
    const id = 'Xbox Controller (STANDARD GAMEPAD)';
    window.pads[index] = { index, id, mapping: 'standard', axes, connected: true, buttons };
    dispatchEvent(new Event('gamepadconnected'));
  };
}"""


def test_a_game_pad_drives_until_it_is_unplugged_and_its_button_stops(
    desktop: Any, world: World
) -> None:
    """tests/web/pads.test.mjs tests in Node what the inputs of each pad mean."""
    desktop.evaluate(PADS)
    choose(desktop, world, Mode.TRAIN)
    rest, ahead = (partial(desktop.evaluate, f"plug(0, [0, {way}, 0, 0])") for way in (0, -1))

    def push() -> None:
        rest()
        desktop.wait_for_timeout(200)  # the page ignores a stick until it was at rest
        ahead()

    press_until(desktop, world, push, rest, lambda: world.action is Action.FORWARD)
    desktop.evaluate("pads[0] = null")
    wait_until(lambda: world.action is Action.STOP, "the gamepad is unplugged")
    desktop.evaluate("plug(1, [0, 0, 0, 0])")
    desktop.wait_for_timeout(200)
    desktop.evaluate("plug(1, [0, 0, 0, 0], 1)")
    wait_until(lambda: world.rig.loop.state.emergency, "the gamepad's button stops")
    desktop.reload()  # removes the gamepads


def test_modes_are_chosen_while_another_finger_holds(phone: Any, world: World) -> None:
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    wanted = world.lessons + 8
    hold_until(world, fingers, "left", lambda: world.lessons > wanted)
    _tap_mode(fingers, "autonomous")
    wait_until(lambda: world.mode is Mode.AUTONOMOUS, "the robot drives by itself")
    fingers.press("mode-bar [data-mode=stopped]", finger=2)
    fingers.slide("video-view", finger=2)
    fingers.lift(finger=2)
    phone.wait_for_timeout(300)
    assert world.mode is not Mode.STOPPED, "a finger that slides off a button does not tap it"
    fingers.lift()


def test_a_finger_that_slides_off_the_pad_lets_go_although_another_tilts(
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
    phone.reload()


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
    assert desktop.evaluate(focused) == "autonomous", "the focus does not move"


def test_space_stops_a_robot_that_may_move_even_if_the_focused_control_uses_space(
    desktop: Any, world: World
) -> None:
    """tests/web/keys.test.mjs tests in Node which key stops the robot in which control."""
    choose(desktop, world, Mode.TRAIN)
    desktop.evaluate(
        """() => {
          document.body.insertAdjacentHTML('beforeend', '<select><option>a');
          document.body.lastElementChild.focus();
        }"""
    )
    desktop.keyboard.press("Space")
    wait_until(lambda: world.rig.loop.state.emergency, "the robot stops")
    desktop.evaluate("document.body.lastElementChild.remove()")
