"""Each way of driving drives the simulated robot; each way of letting go stops it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
    PHONE,
    World,
    new_context,
    open_page,
    remember,
    running_chromium,
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


IS_EMERGENCY = "document.querySelector('app-bar').page.store.state.robot.emergency"
"""What the page knows."""
FAKE_GAMEPAD = """
globalThis.fakePad = {connected: true, index: 0, axes: [0, 0],
  buttons: Array.from({length: 17}, () => ({pressed: false}))};
navigator.getGamepads = () => [globalThis.fakePad];
"""


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
    wait_until_standing(world)
    assert world.rig.loop.state.emergency
    desktop.keyboard.up("Enter")


def test_space_stops_from_every_screen(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    for screen in ("gallery", "teaching", "undo", "lesson", "home", "settings"):
        desktop.evaluate(f"location.hash = '{screen}'")
        desktop.wait_for_selector(f"{screen}-screen")
        assert desktop.locator("app-bar .stop").is_visible()
        desktop.keyboard.press("Space")
        wait_for(lambda: world.rig.loop.state.emergency, f"space stops on {screen}")
        desktop.wait_for_function(f"() => {IS_EMERGENCY}")  # else it would stop by HTTP, too
        world.rig.loop.release_emergency().result(5)
        desktop.wait_for_function(f"() => !{IS_EMERGENCY}")


def test_a_gamepad_drives_and_its_button_stops(chromium: Any, new_robot: World) -> None:
    world = new_robot
    context = chromium.new_context(viewport=PHONE)
    context.add_init_script(FAKE_GAMEPAD)
    page = open_page(context, world.address)
    choose(page, world, Mode.TRAIN)
    page.evaluate("dispatchEvent(new Event('gamepadconnected'))")
    push, let_go = (partial(page.evaluate, f"fakePad.axes = [{x}, 0]") for x in (-1, 0))
    press_until(page, world, push, let_go, turning(world))
    page.evaluate("fakePad.axes = [0, 0]")
    wait_for(lambda: world.action is Action.STOP, "the stick came back")
    page.evaluate("fakePad.buttons[15].pressed = true")
    wait_for(lambda: world.action is Action.RIGHT, "the cross drives")
    page.evaluate("fakePad.buttons[1].pressed = true")
    wait_for(lambda: world.rig.loop.state.emergency, "its button stops")
    context.close()


@pytest.fixture
def whole_chromium() -> Iterator[Any]:
    """The Chromium with windows, though none is opened: the other one knows no leaning phone."""
    with running_chromium(whole=True) as browser:
        yield browser


def test_tilting_drives_while_the_thumb_rests(whole_chromium: Any, new_robot: World) -> None:
    world = new_robot
    context = whole_chromium.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    context.add_init_script(remember(hintsShown=["teach", "bars", "correct"], tilt=True))
    page = open_page(context, world.address, hints=True)
    lean = context.new_cdp_session(page)

    def tilt(beta: float, gamma: float) -> None:
        lean.send(
            "DeviceOrientation.setDeviceOrientationOverride",
            {"alpha": 0, "beta": beta, "gamma": gamma},
        )

    choose(page, world, Mode.TRAIN)
    fingers = Fingers(page)

    def lean_left() -> None:
        tilt(40, 0)
        fingers.press(".move.tilt")
        page.wait_for_timeout(300)
        assert world.action is Action.STOP, "upright is as it was when the thumb went down"
        tilt(40, -30)

    press_until(page, world, lean_left, fingers.lift, turning(world))
    assert world.action is Action.LEFT
    tilt(10, 0)
    wait_for(lambda: world.action is Action.FORWARD, "leaning away drives on")
    fingers.lift()
    wait_until_standing(world)
    context.close()


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
    fingers.press(pad("right"))
    wait_for(lambda: world.action is Action.RIGHT, "the other layout drives")
    fingers.lift()


def test_a_second_tab_watches_asks_and_takes_over_politely(chromium: Any, new_robot: World) -> None:
    world = new_robot
    contexts = [new_context(chromium, PHONE) for _ in range(2)]
    phone, second = (open_page(context, world.address) for context in contexts)
    second.locator(".notice", has_text="Somebody else has the wheel").wait_for()
    assert second.locator("[data-mode=train]").is_disabled()
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "left", turning(world))
    others = Fingers(second)
    others.press(pad("forward"))
    second.wait_for_timeout(300)
    assert world.action is Action.LEFT, "who watches cannot drive"
    others.lift()
    second.locator(".notice button").tap()
    phone.locator(".notice button", has_text="Give it").wait_for()
    assert world.action is Action.LEFT, "asking stops nobody"
    fingers.lift()
    phone.locator(".notice button").tap()
    second.wait_for_selector("[data-mode=train]:not([disabled])")
    assert world.mode is Mode.STOPPED, "a change of hands stops the robot"
    second.locator("drive-pad .stop").tap()
    wait_for(lambda: world.rig.loop.state.emergency, "anybody may stop it")
    for context in contexts:
        context.close()
