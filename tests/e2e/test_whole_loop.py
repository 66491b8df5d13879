"""On a phone, a person can teach the robot, let it drive, correct it and stop it."""

from __future__ import annotations

from typing import Any

import pytest

from robot.policy.undo import last_examples
from robot.types import Action, DrivenBy, Mode
from tests.kit.wait import wait_until

from .hand import Fingers, choose, hold_until, pad, teach, turned_rad
from .world import World


@pytest.fixture
def frame_rate_hz() -> float:
    """A high rate, so that teaching takes little time."""
    return 30.0


def agreement(page: Any) -> float:
    """Agreement as the page shows it, in percent; -1 before there is any."""
    text = page.locator("teach-panel strong").inner_text()
    return float(text.split()[0]) if "%" in text else -1.0


BOTH = (Action.FORWARD, Action.LEFT)


def learned(world: World) -> float:
    """Return the share of taught examples for which the robot now proposes the taught move.

    It is the mean over both moves, so a robot that always proposes one move reaches a half.

    The page's agreement varies more: it counts the newest examples, each before it was learned.
    """
    history = world.rig.loop.history

    def ask() -> float:
        right: dict[Action, list[bool]] = {move: [] for move in BOTH}
        for taught in last_examples(history, 1000.0):
            shares = history.policy.learner.explain_one(taught.x).probabilities
            label = taught.example.label
            right[label].append(max(shares, key=lambda m: shares[m]) is label)
        return sum(sum(told) / len(told) for told in right.values()) / len(BOTH)

    return world.rig.loop.submit(ask).result(60)


@pytest.mark.parametrize("world", ["box"], indirect=True)
def test_teach_drive_correct_and_stop_in_the_simulator(phone: Any, world: World) -> None:
    phone.emulate_media(reduced_motion="no-preference")
    fingers = Fingers(phone)
    start = world.pose
    assert world.mode is Mode.STOPPED

    choose(phone, world, Mode.TRAIN)
    loop = world.rig.loop
    teach(
        world,
        fingers,
        2000,
        until=lambda: min(loop.state.taught.get(move, 0) for move in BOTH) >= 40,
    )
    assert world.pose != start, "the pilot's finger drove the robot"
    choose(phone, world, Mode.STOPPED)
    assert learned(world) >= 0.75, "the robot proposes the moves that it was taught"
    shown = world.rig.loop.state.agreement
    assert shown is not None
    wait_until(lambda: abs(agreement(phone) - 100 * shown) <= 1, "the page shows the agreement")

    choose(phone, world, Mode.AUTONOMOUS)
    here = world.pose
    wait_until(lambda: world.pose != here, "the robot drives itself")
    assert world.rig.loop.state.decision.driven_by is DrivenBy.ROBOT
    phone.wait_for_selector("video-view[data-by=robot]")

    lessons = world.lessons
    fingers.press(pad("right"))
    phone.wait_for_selector("video-view[data-by=pilot]")
    wait_until(lambda: world.action is Action.RIGHT, "the touch takes the wheel")
    assert turned_rad(world, 0.6) < -0.02, "the robot turns right, as the finger says"
    wait_until(lambda: world.lessons > lessons, "the touch is a lesson")

    fingers.lift()
    phone.wait_for_selector("video-view[data-by=robot]")
    here = world.pose
    wait_until(lambda: world.pose != here, "the robot drives on after the correction")

    for drawn in (".way.pilot[d^=M]", ".way.robot[d^=M]", ".mark.corrected"):
        phone.locator(f"drive-map {drawn}").first.wait_for(state="attached")
    phone.locator(".like").tap()
    phone.locator("why-screen .alike image").nth(1).wait_for(state="attached")
    assert world.mode is Mode.AUTONOMOUS, "the robot drives on while the page explains a move"
    phone.locator("app-bar .back").tap()
    phone.wait_for_selector("video-view[data-by=robot]")

    choose(phone, world, Mode.STOPPED)
    here = world.pose
    phone.wait_for_timeout(300)
    assert world.pose == here, "a stopped robot does not move"
    an_emergency_stop_is_latched_until_it_is_released(phone, world, fingers)


def an_emergency_stop_is_latched_until_it_is_released(
    phone: Any, world: World, fingers: Fingers
) -> None:
    choose(phone, world, Mode.TRAIN)
    hold_until(world, fingers, "left", lambda: world.action is Action.LEFT)
    phone.locator("drive-pad .stop").dispatch_event("click")
    wait_until(lambda: world.rig.loop.state.emergency, "the emergency stop is latched")
    phone.wait_for_selector("mode-bar [data-mode=train][aria-disabled=true]")
    fingers.lift()
    phone.locator(".notice button").tap()
    wait_until(lambda: not world.rig.loop.state.emergency, "the stop is released")
    assert world.mode is Mode.STOPPED, "the robot waits for an explicit start"
    here = world.pose
    phone.wait_for_timeout(500)
    assert world.pose == here, "after the release, the robot still stands"
    assert not world.rig.loop.state.emergency, "after the release, no further STOP arrives"
    choose(phone, world, Mode.TRAIN)
