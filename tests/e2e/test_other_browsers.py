"""The whole loop in Firefox and WebKit: open, hold, train, let it drive, stop."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from typing import Any

import pytest

from robot.types import DrivenBy, Mode
from tests.kit.wait import wait_until

from .hand import pad
from .other_browsers import OtherBrowser, missing, running
from .world import World, remember

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not os.environ.get("DRIVELESSON_OTHER_BROWSERS"),
        reason="THE PAGE WAS NOT TESTED IN FIREFOX AND WEBKIT: make test-browsers",
    ),
]


def hold(page: OtherBrowser, selector: str, seconds: float = 0.0) -> None:
    """Hold the middle of an element with the mouse for some time."""
    box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
    at = json.loads(page.evaluate(f"JSON.stringify({box})"))
    middle = {"x": round(at["x"] + at["width"] / 2), "y": round(at["y"] + at["height"] / 2)}
    act(
        page, {"type": "pointerMove", "duration": 0, **middle}, {"type": "pointerDown", "button": 0}
    )
    time.sleep(seconds)
    act(page, {"type": "pointerUp", "button": 0})


def act(page: OtherBrowser, *moves: dict[str, Any]) -> None:
    source = {"type": "pointer", "id": "finger", "parameters": {"pointerType": "mouse"}}
    page.perform([{**source, "actions": list(moves)}])


def repeat_until(is_so: Callable[[], object], do: Callable[[], object]) -> None:
    """Do something again and again, because a busy machine stops the robot."""

    def is_so_now() -> bool:
        if not is_so():
            do()
            time.sleep(0.4)
        return bool(is_so())

    wait_until(is_so_now)


def shows(page: OtherBrowser, expression: str) -> None:
    """Wait until a condition holds on the page."""
    wait_until(lambda: bool(page.evaluate(f"Boolean({expression})")), expression)


@pytest.mark.parametrize("world", ["box"], indirect=True)
@pytest.mark.parametrize("name", ["firefox", "webkit"])
def test_teach_drive_and_stop(name: str, world: World) -> None:
    lacking = missing(name)
    if lacking:
        pytest.skip(f"THE PAGE WAS NOT TESTED IN {name.upper()}: {lacking}")
    loop, start = world.rig.loop, world.pose
    with running(name) as page:
        page.goto(world.address)
        shows(page, "document.querySelector('video-view[data-frames]')")
        page.evaluate(f"({remember(hintsShown=['teach', 'bars', 'correct'])}, true)")

        def choose(mode: str) -> None:
            hold(page, f"mode-bar [data-mode={mode}]")

        def teach(move: str) -> None:
            if world.mode is Mode.STOPPED:
                choose("train")
                time.sleep(0.3)
            hold(page, pad(move), 0.6)

        for move in ("forward", "left", "forward"):
            wanted = world.lessons + 12
            repeat_until(lambda n=wanted: world.lessons >= n, lambda m=move: teach(m))
        assert world.pose != start, "the pilot's finger drove the robot"
        shows(page, "document.querySelector('teach-panel strong').textContent.includes('%')")
        repeat_until(lambda: world.mode is Mode.AUTONOMOUS, lambda: choose("autonomous"))
        wait_until(
            lambda: (
                loop.state.decision.driven_by is DrivenBy.ROBOT or loop.state.decision.asks_pilot
            ),
            "it drives, or asks",
        )
        hold(page, "drive-pad .stop")
        wait_until(lambda: loop.state.emergency, "STOP is latched")
        shows(page, "document.querySelector('mode-bar [data-mode=train][aria-disabled=true]')")
        for screen in ("gallery", "home", "settings"):
            page.evaluate(f"(location.hash = '{screen}', true)")
            shows(page, f"document.querySelector('{screen}-screen button')")
        shows(page, "document.documentElement.scrollWidth <= innerWidth")
