"""Each way of driving drives the simulated robot; each way of letting go stops it."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robot.types import Action, Mode
from tests.kit.sizes import crossed, in_ci, size
from tests.kit.wait import wait_until

from .hand import (
    Fingers,
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
from .world import (
    LANDSCAPE,
    World,
    release_stop,
)

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
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    hold_until(world, fingers, "forward", lambda: world.action is Action.FORWARD)
    fingers.slide(pad("right"))
    wait_until(lambda: world.action is Action.RIGHT, "the finger slid to the right")
    assert turned_rad(world) < -0.02
    fingers.press(pad("left"), finger=2)
    wait_until(lambda: world.action is Action.LEFT, "the newer finger counts")
    fingers.lift(finger=2)
    wait_until(lambda: world.action is Action.RIGHT, "the older one is still there")
    fingers.lift(finger=1)
    wait_until(lambda: world.action is Action.STOP, "nothing is held")
    assert phone.evaluate("visualViewport.scale") == 1, "two fingers do not zoom"


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
    note = """() => {
      const { helm, store } = document.querySelector('app-bar').page;
      helm.addEventListener('held', () => window.changes?.push(helm.held));
      store.watch(['link', 'robot'], ({ link, robot }) => (
        window.isStopped ||= link !== 'open' || robot?.mode !== 'train'));
    }"""
    desktop.evaluate(note)
    for _ in range(20):
        choose(desktop, world, Mode.TRAIN)
        desktop.locator(pad("left")).focus()
        desktop.evaluate("Object.assign(window, { changes: [], isStopped: false })")
        for _ in range(10):  # as a keyboard repeats it
            desktop.keyboard.down("Enter")
            desktop.wait_for_timeout(40)
        held = desktop.evaluate("changes")
        desktop.keyboard.up("Enter")
        wait_until_standing(world)
        if not desktop.evaluate("isStopped"):  # a busy computer stops a robot, rightly
            break
    else:
        pytest.fail("it was stopped each time")
    assert held == ["left"]
    assert desktop.evaluate("changes") == ["left", None]


def test_space_stops_from_every_screen(desktop: Any, world: World) -> None:
    choose(desktop, world, Mode.TRAIN)
    for screen in ("gallery", "teaching", "undo", "home", "settings"):
        desktop.evaluate(f"location.hash = '{screen}'")
        desktop.wait_for_selector(f"{screen}-screen")
        assert desktop.locator("app-bar .stop").is_visible()
        desktop.keyboard.press("Space")
        wait_until(lambda: world.rig.loop.state.emergency, f"space stops on {screen}")
        release_stop(desktop, world)


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
        played = desktop.evaluate(PLAY, {"histories": histories, "isLive": False})
        assert played["wrong"] == []
        assert played["counts"]["stops"] and played["counts"]["driven"]
    desktop.reload()  # its robot answers again
    wait_until_standing(world)


@in_ci
def test_no_generated_keyboard_drives_on_beside_the_robot(desktop: Any, world: World) -> None:
    """Its answers come late at their own pace; node tests most histories
    (tests/web/keys.test.mjs)."""
    played = desktop.evaluate(PLAY, {"histories": _histories(1, 40), "isLive": True})
    assert played["wrong"] == []
    assert played["counts"]["stops"] and played["counts"]["driven"]
    wait_until_standing(world)


SET_HIDDEN = """(hidden) => {
  Object.defineProperty(document, 'hidden', { get: () => hidden, configurable: true });
  document.dispatchEvent(new Event('visibilitychange'));
}"""


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


@crossed(name=LETTING_GO, by=["moves", "stick"])
def test_letting_go_stops(phone: Any, world: World, name: str, by: str) -> None:
    """The page reports it while it handles the event itself. Later delays are due to the link, and
    from there the table of faults applies, in virtual time (tests/faults)."""
    steer_by(phone, by)
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    drives = turning(world)
    press_until(phone, world, lambda: hold_left(fingers, by), fingers.lift, drives)
    event, let_go = LETTING_GO[name]
    phone.evaluate(NOTE_SAID)
    let_go(phone, fingers)
    wait_until_standing(world)
    if not event:
        return
    said = phone.evaluate("said.filter(([held], i) => !held && (i === 0 || said[i - 1][0]))")
    assert said == [[None, event]], "let go of once, at once, and held no more"
    if not fingers.are_lifted:
        phone.evaluate(SET_HIDDEN, False)
        phone.evaluate("location.hash = 'drive'")
        release_stop(phone, world)
        choose(phone, world, Mode.TRAIN)
        lain_on = pad("left") if by == "moves" else stick()
        trembling = ((0.1, 0.1), (0.0, 0.0), (-0.8, 0.1)) if event != "pointermove" else ()
        for at in trembling:  # as a finger does that lies on
            fingers.slide(lain_on, at=at)
        wait_until_standing(world)
        assert phone.evaluate("said.at(-1)[0]") is None, "what is still held must be held anew"
        fingers.cancel()
    phone.evaluate(SET_HIDDEN, False)
    steer_by(phone, "moves")


def test_a_stick_steers_by_degrees_to_both_sides(phone: Any, world: World) -> None:
    steer_by(phone, "stick")
    choose(phone, world, Mode.TRAIN)
    fingers = Fingers(phone)
    press_until(
        phone, world, lambda: fingers.press(stick(), at=(-0.5, 0.7)), fingers.lift, turning(world)
    )
    for way, side in {(-0.5, 0.7): -1, (0.5, 0.7): 1, (0.3, 0.9): 1, (0.0, 0.9): 0}.items():
        fingers.slide(stick(), at=way)
        wait_until(lambda w=way: near(world, w[0]), f"the wheels are turned to {way}")
        assert world.action is {-1: Action.LEFT, 1: Action.RIGHT, 0: Action.FORWARD}[side]
    fingers.slide(stick(), at=(1.5, 0.4))
    wait_until(lambda: near(world, 1.0), "over the edge it is held to its end")
    fingers.slide(stick(), at=(0.02, 0.0))
    wait_until(lambda: world.action is Action.STOP, "a thumb that rests drives nowhere")
    fingers.slide(stick(), at=(0.0, 0.9))
    wait_until(lambda: world.action is Action.FORWARD, "and drives on")
    fingers.lift()
    wait_until_standing(world)


def test_what_is_taught_by_degrees_is_seen_over_the_picture_and_in_the_gallery(
    phone: Any, world: World
) -> None:
    steer_by(phone, "stick")
    choose(phone, world, Mode.TRAIN)
    fingers, wanted = Fingers(phone), world.lessons + 8
    press_until(
        phone,
        world,
        lambda: fingers.press(stick(), at=(-0.5, 0.7)),
        fingers.lift,
        lambda: world.lessons > wanted,
    )
    needle = phone.locator("video-view .needle[aria-label*='taught -4']")
    needle.wait_for()
    assert phone.locator("video-view .needle [class^=at-]:visible").count() >= 2
    fingers.lift()
    wait_until_standing(world)
    phone.evaluate("location.hash = 'gallery'")
    phone.locator(".card .needle[aria-label*='taught -']").first.wait_for()


def near(world: World, steering: float) -> bool:
    """True if the robot is driven about this far to one side."""
    point = world.rig.loop.state.decision.point
    return point is not None and abs(point.steering - steering) < 0.25


@pytest.mark.parametrize("side", ["left", "right"])
def test_each_thumb_has_a_stick_when_the_phone_lies_on_its_side(
    phone: Any, world: World, side: str
) -> None:
    steer_by(phone, "stick")
    phone.set_viewport_size(LANDSCAPE)
    phone.wait_for_function(f"() => innerWidth === {LANDSCAPE['width']}")
    choose(phone, world, Mode.TRAIN)
    box = phone.locator(stick(side)).bounding_box()
    middle = (box["x"] + box["width"] / 2) / LANDSCAPE["width"]
    assert middle < 0.3 if side == "left" else middle > 0.7
    fingers = Fingers(phone)
    press_until(
        phone,
        world,
        lambda: fingers.press(stick(side), at=(0.7, 0.5)),
        fingers.lift,
        lambda: world.action is Action.RIGHT and near(world, 0.7),
    )
    fingers.lift()
    wait_until_standing(world)


def test_each_thumb_has_its_moves_when_the_phone_lies_on_its_side(phone: Any) -> None:
    phone.set_viewport_size(LANDSCAPE)
    phone.wait_for_function(f"() => innerWidth === {LANDSCAPE['width']}")
    left, _, forward = (phone.locator(pad(m)).bounding_box() for m in ("left", "right", "forward"))
    assert left["x"] + left["width"] < LANDSCAPE["width"] / 3, "turns: left thumb"
    assert forward["x"] > LANDSCAPE["width"] * 2 / 3, "forward: right thumb"


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


def test_what_drives_itself_stops_when_nobody_sees_it(phone: Any, world: World) -> None:
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
          const set = page.store.set.bind(page.store);
          page.store.set = () => {}; // what the robot itself tells meanwhile
          window.tell = (mode, stage, link = 'good') => set({
            link: 'open', localStop: null, notice: null, toast: null,
            robot: { ...page.store.state.robot, mode, lessons: 300, stop_reason: null,
              camera: null, busy: false, link,
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
    shown = phone.evaluate(
        """["good", "slow", "good"].map((link) => (tell('autonomous', 'ready', link),
          document.querySelector('teach-panel').classList.value.split(' ').sort().join(' ')))"""
    )
    assert shown == ["joy ready", "joy noticing", "joy ready"], "a notice only hides it"
    phone.evaluate("(tell('train', 'ready'), tell('autonomous', 'ready'))")
    assert phone.evaluate("notes") == 3, "it was told once"
    phone.evaluate("tell('autonomous', 'try')")
    phone.evaluate("document.querySelector('app-bar').page.preferences.set('sound', false)")
    phone.evaluate("tell('autonomous', 'ready')")
    assert phone.evaluate("notes") == 3, "muted"
