"""In Firefox and WebKit, a person can teach the robot, let it drive, and stop it."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from typing import Any

import pytest

from robot.types import Action, DrivenBy, Mode
from tests.kit.wait import wait_until

from .other_browsers import OtherBrowser, missing, running
from .world import World, remember

pytestmark = pytest.mark.skipif(
    not os.environ.get("DRIVELESSON_OTHER_BROWSERS"),
    reason="THE PAGE WAS NOT TESTED IN FIREFOX AND WEBKIT: make test-browsers",
)
STEP_S = 60.0


class Hand:
    """A finger on the page in Firefox or WebKit, or a mouse if the browser has no touch."""

    def __init__(self, page: OtherBrowser) -> None:
        self._page = page

    def press(self, selector: str) -> None:
        self._act({"type": "pointerMove", "duration": 0, **self._middle(selector)}, _DOWN)

    def lift(self) -> None:
        self._act({"type": "pointerUp", "button": 0})

    def tap(self, selector: str) -> None:
        self.press(selector)
        self.lift()

    def _act(self, *moves: dict[str, Any]) -> None:
        source = {"type": "pointer", "id": "finger", "parameters": {"pointerType": "mouse"}}
        self._page.perform([{**source, "actions": list(moves)}])

    def _middle(self, selector: str) -> dict[str, int]:
        box = json.loads(
            self._page.evaluate(
                f"JSON.stringify(document.querySelector({json.dumps(selector)})"
                ".getBoundingClientRect())"
            )
        )
        return {
            "x": round(box["x"] + box["width"] / 2),
            "y": round(box["y"] + box["height"] / 2),
        }


_DOWN = {"type": "pointerDown", "button": 0}


@pytest.mark.parametrize("world", ["box"], indirect=True)
@pytest.mark.parametrize("name", ["firefox", "webkit"])
def test_teach_drive_and_stop(name: str, world: World) -> None:
    lacking = missing(name)
    if lacking:
        pytest.skip(f"THE PAGE WAS NOT TESTED IN {name.upper()}: {lacking}")
    with running(name) as page:
        page.goto(world.address)
        until(page, "Boolean(document.querySelector('video-view[data-frames]'))")
        page.evaluate(f"({remember(hintsShown=['teach', 'bars', 'correct'])}, true)")
        hand = Hand(page)

        _choose(page, hand, world, Mode.TRAIN)
        start = world.pose
        for move in (Action.FORWARD, Action.LEFT, Action.FORWARD):
            _teach(hand, world, move, world.lessons + 12)
        assert world.pose != start, "the pilot's finger drove the robot"
        until(page, "document.querySelector('teach-panel strong').textContent.includes('%')")

        _choose(page, hand, world, Mode.AUTONOMOUS)
        _until(
            lambda: (
                world.rig.loop.state.decision.driven_by is DrivenBy.ROBOT
                or world.rig.loop.state.decision.asks_pilot
            ),
            "it drives, or asks",
        )
        hand.tap("drive-pad .stop")
        _until(lambda: world.rig.loop.state.emergency, "STOP is latched")
        until(
            page,
            "Boolean(document.querySelector('mode-bar [data-mode=train][aria-disabled=true]'))",
        )
        here = world.pose
        time.sleep(0.3)
        assert world.pose == here
        for screen in ("gallery", "home", "settings"):
            page.evaluate(f"(location.hash = '{screen}', true)")
            until(page, f"document.querySelectorAll('{screen}-screen button').length > 0")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def _choose(page: OtherBrowser, hand: Hand, world: World, mode: Mode) -> None:
    """Tap a mode, and tap it again after each stop, because a busy machine may stop the robot."""
    deadline_s = time.monotonic() + STEP_S
    while world.mode is not mode:
        assert time.monotonic() < deadline_s, f"the robot does not stay in mode {mode.value}"
        hand.tap(f"mode-bar [data-mode={mode.value}]")
        time.sleep(0.4)


def _teach(hand: Hand, world: World, move: Action, lessons: int) -> None:
    """Hold a move until the robot has learned enough; hold it again after each stop."""
    deadline_s = time.monotonic() + STEP_S
    while world.lessons < lessons:
        assert time.monotonic() < deadline_s, f"holding {move} taught {world.lessons} of {lessons}"
        if world.mode is Mode.STOPPED:
            hand.tap("mode-bar [data-mode=train]")
            time.sleep(0.3)
        hand.press(f"drive-pad .move[data-move={move.value}]")
        time.sleep(0.6)
        hand.lift()


def _until(condition: Callable[[], bool], what: str) -> None:
    wait_until(condition, what, STEP_S)


def until(page: OtherBrowser, expression: str) -> None:
    """Wait until a condition holds on the page."""
    wait_until(lambda: bool(page.evaluate(expression)), expression, STEP_S)
