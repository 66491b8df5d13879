"""A hand on the touch screen: fingers that hold, and the actions of a patient person."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from typing import Any

from robot.types import Mode

from .world import World

SET_HIDDEN = """(hidden) => {
  Object.defineProperty(document, 'hidden', { get: () => hidden, configurable: true });
  document.dispatchEvent(new Event('visibilitychange'));
}"""
"""A script that hides the page, as a browser does when the person opens another tab."""
Way = tuple[float, float]
"""Offset from a control's middle, to the right and upwards, in shares of its width and height."""
MIDDLE: Way = (0.0, 0.0)
_LET_GO = 25
"""After this number of checks in a row without a held move, the page has let go."""


class Fingers:
    """Fingers on a touch screen, each held until it is lifted."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self._cdp = page.context.new_cdp_session(page)
        self._points: dict[int, dict[str, float]] = {}

    def press(self, selector: str, finger: int = 1, at: Way = MIDDLE) -> None:
        self._points[finger] = {**self._place(selector, at), "id": finger}
        self._send("touchStart", finger)

    def slide(self, selector: str, finger: int = 1, at: Way = MIDDLE) -> None:
        self._points[finger] = {**self._place(selector, at), "id": finger}
        self._send("touchMove", finger)

    def lift(self, finger: int = 1) -> None:
        self._send("touchEnd", finger)
        del self._points[finger]

    @property
    def are_lifted(self) -> bool:
        return not self._points

    def cancel(self) -> None:
        self._points.clear()
        self._send("touchCancel")

    def _send(self, kind: str, finger: int | None = None) -> None:
        points = [] if finger is None else [self._points[finger]]
        self._cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def _place(self, selector: str, at: Way) -> dict[str, float]:
        box = self.page.locator(selector).first.bounding_box()
        assert box is not None, f"{selector} is not on the screen"
        radius = min(box["width"], box["height"]) / 2
        (x, y), (right, ahead) = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2), at
        return {"x": x + radius * right, "y": y - radius * ahead}


def teach(
    world: World,
    fingers: Fingers,
    lessons: int,
    *,
    near_m: float = 0.35,
    until: Callable[[], bool] = lambda: False,
) -> None:
    """Drive like a person: straight on, and left before an obstacle."""
    held: str | None = None
    deadline_s = time.monotonic() + 100
    while world.lessons < lessons and not until():
        assert time.monotonic() < deadline_s, f"the robot has learned only {world.lessons} examples"
        if world.mode is Mode.STOPPED:  # the machine was busy and late, so the robot stopped
            if held:
                fingers.lift()
            held = None
            fingers.page.locator("mode-bar [data-mode=train]").click()
            time.sleep(0.3)
        patience_m = near_m if held == "forward" else near_m * 1.3
        wanted = "left" if world.distance_m < patience_m else "forward"
        if wanted != held:
            if held:
                fingers.lift()
            fingers.press(pad(wanted))
            held = wanted
        time.sleep(0.03)
    if held:
        fingers.lift()


def pad(move: str) -> str:
    """Selector of a button of the pad."""
    return f"drive-pad .move[data-move={move}]"


def stick(side: str = "left") -> str:
    """Selector of the left or right thumb stick; the right one needs space on the screen."""
    return f"drive-pad .stick.{side}"


def steer_by(page: Any, by: str) -> None:
    """Choose in the settings how this robot is steered: by `moves` or by a `stick`."""
    page.evaluate(
        """(isStick) => {
          const { page } = document.querySelector('app-bar');
          page.preferences.chooseStick(page.store.state.robotName, isStick);
          page.followPreferences();
        }""",
        by == "stick",
    )
    page.wait_for_selector(stick() if by == "stick" else pad("left"))


def hold_left(fingers: Fingers, by: str, finger: int = 1) -> None:
    """Hold the input that turns the robot left: the arrow, or the stick to one side."""
    if by == "stick":
        fingers.press(stick(), finger, at=(-0.8, 0.2))
    else:
        fingers.press(pad("left"), finger)


def choose(page: Any, world: World, mode: Mode) -> None:
    """Choose a mode on the page, and tap again if the robot was stopped at once (a restored link is
    still slow); wait until the robot is in the mode."""
    button = page.locator(f"mode-bar [data-mode={mode.value}]")
    shown = page.locator(f"mode-bar [data-mode={mode.value}][aria-checked=true]")
    deadline_s = time.monotonic() + 40.0
    while not (world.mode is mode and shown.count()):
        assert time.monotonic() < deadline_s, f"the robot does not stay in {mode.value}: {world}"
        if world.mode is not mode and button.is_enabled():
            button.click()
        # the robot was stopped at once, or the request arrived late
        with contextlib.suppress(Exception):
            shown.wait_for(timeout=1000)
        page.wait_for_timeout(20)


def press_until(
    page: Any,
    world: World,
    press: Callable[[], object],
    let_go: Callable[[], object],
    done: Callable[[], bool],
    within_s: float = 100.0,
) -> None:
    """Hold an input until a condition holds, and keep holding; begin again after each stop.

    A busy machine is late, so the robot stops. A page that learns of a stop after the next start
    releases the inputs held until then.
    """
    deadline_s = time.monotonic() + within_s
    press()
    held_nothing = 0
    while not done():
        assert time.monotonic() < deadline_s, (
            f"not done in {within_s} s: {world}; {_held(page)} is held"
        )
        held_nothing = 0 if _held(page) is not None else held_nothing + 1
        if world.mode is Mode.STOPPED or held_nothing > _LET_GO:
            let_go()
            choose(page, world, Mode.TRAIN)
            press()
            held_nothing = 0
        time.sleep(0.04)


def _held(page: Any) -> str | None:
    held: str | None = page.evaluate("document.querySelector('app-bar').page.helm.held")
    return held


def hold_until(
    world: World, fingers: Fingers, move: str, done: Callable[[], bool], within_s: float = 100.0
) -> None:
    """Hold a direction until a condition holds, as `press_until` does."""
    press_until(fingers.page, world, lambda: fingers.press(pad(move)), fingers.lift, done, within_s)


def drive_on(page: Any, world: World, *, until: Callable[[], bool], within_s: float = 60.0) -> None:
    """Have the robot drive by itself, again after each stop, like a patient person."""
    deadline_s = time.monotonic() + within_s
    while not until():
        assert time.monotonic() < deadline_s, f"the condition does not hold within {within_s} s"
        if world.mode is Mode.STOPPED:
            page.locator("mode-bar [data-mode=autonomous]").click()
            time.sleep(0.3)
        time.sleep(0.05)


def turned_rad(world: World, seconds: float = 0.4) -> float:
    """Return the angle by which the robot turns to the left in this time."""
    before = world.pose.heading_rad
    time.sleep(seconds)
    return math.remainder(world.pose.heading_rad - before, math.tau)


def turning(world: World) -> Callable[[], bool]:
    """Return a function that says whether the robot has turned since this call."""
    before = world.pose.heading_rad
    return lambda: abs(world.pose.heading_rad - before) > 0.03


def wait_until_standing(world: World, within_s: float = 30.0) -> None:
    """Wait until the robot's body stands, and print the time that this took."""
    since_s = time.monotonic()
    pose, moved_s = world.pose, since_s
    while time.monotonic() - moved_s < 0.3:
        time.sleep(0.005)
        now_s, now = time.monotonic(), world.pose
        if now != pose:
            pose, moved_s = now, now_s
        assert now_s - since_s < within_s, f"the robot still moves after {within_s} s"
    print(f"the robot stood after {moved_s - since_s:.3f} s")
