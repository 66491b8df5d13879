"""The whole path with a camera like an EV3's: real agent, real server, a page's program.

Version 0.1 asked to be started 57 times in twelve seconds and learned 14 of 120 pictures. It would
fail here, because `MOST_STARTS` must be enough for 60 examples. Virtual time tests the gate's
limits (tests/robot/control/test_camera_timing.py); the shares are printed as a report.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from tests.kit.sizes import in_ci
from tests.robot.bodies.ev3.fake_video import C270_ON_EV3, DEVICE, QUICK, CameraTraits, FakeVideo
from tests.robot.bodies.ev3.own_server import own_server
from tests.robot.bodies.ev3.running_agent import SECRET, RunningAgent
from tests.server.live_robot import Pilot

EXAMPLES, MOST_STARTS = 60, 40
pytestmark = [pytest.mark.slow, pytest.mark.realtime]
TRAITS = {
    "a C270 on an EV3": C270_ON_EV3,
    "100 ms / 145 ms": replace(C270_ON_EV3, age_ms=145, age_spread_ms=0),
    "100 ms / 95 ms": replace(C270_ON_EV3, age_ms=95, age_spread_ms=0),
    "33 ms / 5 ms": QUICK,
}


@dataclass(frozen=True)
class Shares:
    """The results of the time for which a direction was held, and of its pictures."""

    starts: int
    moving: float
    full_speed: float
    learned: float


def ask_to_start(pilot: Pilot) -> None:
    """Request a start once. A busy computer may refuse; the caller checks the result and counts."""
    pilot.mode("train")
    with contextlib.suppress(AssertionError):
        pilot.wait_for_state(5, mode="train")


def teach(pilot: Pilot) -> Shares:
    """Hold forward until enough was learned; start again as often as the robot asks for it."""
    pilot.hold("forward")
    starts = 0
    states: list[dict[str, Any]] = []
    while not states or states[-1]["lessons"] - states[0]["lessons"] < EXAMPLES:
        if pilot.state["mode"] != "train":
            starts += 1
            assert starts <= MOST_STARTS, pilot.state
            ask_to_start(pilot)
        state = pilot.wait_for(lambda m: m["type"] == "state", 60, seen=len(pilot.messages))
        if states or state["action"] == "forward":
            states.append(state)
    pictures = states[-1]["frame"] - states[0]["frame"]
    return Shares(
        starts=starts,
        moving=sum(state["action"] == "forward" for state in states) / len(states),
        full_speed=sum(state["speed_scale"] == 1.0 for state in states) / len(states),
        learned=(states[-1]["lessons"] - states[0]["lessons"]) / pictures,
    )


# In virtual time: tests/robot/control/test_camera_timing.py.


@in_ci
def test_it_drives_and_learns_with_the_camera_that_it_has(
    real_brick: FakeBrick, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, name in enumerate(TRAITS):
        folder = tmp_path / str(number)
        folder.mkdir()
        shares = drive_with(TRAITS[name], real_brick, folder)
        with capsys.disabled():
            print(f"\n{name}: {shares} (asked on a quiet machine: 1, 0.99, 0.9, 0.98)")
    for age_ms, check in ((300, it_slows_down_and_shows_why), (600, it_does_not_move)):
        folder = tmp_path / str(age_ms)
        folder.mkdir()
        real_brick.commands.clear()
        traits = replace(C270_ON_EV3, age_ms=age_ms, age_spread_ms=0)
        with piloted(traits, real_brick, folder) as pilot:
            pilot.hold("forward")
            check(real_brick, pilot)


def start(pilot: Pilot) -> None:
    """Request a start until the robot moves, because the first pictures may be too old."""
    for _ in range(10):
        pilot.mode("train")
        with contextlib.suppress(AssertionError):
            pilot.wait_for_state(5, action="forward")
            return
    raise AssertionError(f"it never started: {pilot.state}")


def it_slows_down_and_shows_why(brick: FakeBrick, pilot: Pilot) -> None:
    start(pilot)
    # The first pictures are slow, too, before the offset of the two clocks is known.
    state = pilot.wait_for(
        lambda m: (
            m["type"] == "state"
            and m["speed_scale"] < 0.9
            and m["camera"]["brick_ms"] is not None
            and m["camera"]["age_ms"] >= 290  # an estimate grows slowly while the robot moves
        ),
        60,
    )
    own_ms = state["camera"]["age_ms"] - state["camera"]["brick_ms"]
    assert state["camera"]["brick_ms"] == 0 or own_ms >= 290, "the camera's part is told apart"
    for _ in range(10):  # a paused computer has stopped it
        with contextlib.suppress(AssertionError):
            brick.wait_until(lambda: 0 < brick.speeds()["outB"] < 324, 5)  # of 360
            return
        start(pilot)
    pytest.fail(f"it does not drive slowly: {brick.speeds()}")


def it_does_not_move(brick: FakeBrick, pilot: Pilot) -> None:
    """Request until ten pictures were too old: a computer that was paused refuses, too."""
    reasons: list[str] = []
    while reasons.count("frame_stale") < 10:
        assert len(reasons) < MOST_STARTS, reasons
        ask_to_start(pilot)
        reasons.append(pilot.wait_for_state(60, mode="stopped")["stop_reason"])
    assert not [one for one in brick.commands if one.command.startswith("run")]


@contextmanager
def piloted(traits: CameraTraits, brick: FakeBrick, folder: Path) -> Iterator[Pilot]:
    """Agent, server, and a pilot who sees the camera's pictures."""
    video = FakeVideo(folder, traits)
    options = ["--robot", "ev3-remote", "--brick-secret", SECRET, "--device", DEVICE]
    options += ["--data", str(folder / "data")]
    with (
        RunningAgent(brick.root, folder, video.env) as agent,
        own_server(*options, "--brick", agent.address) as (_, address),
        Pilot(address + "/ws/drive", sees=True) as pilot,
    ):
        pilot.wait_for_state(60, you_are_pilot=True)
        yield pilot


def drive_with(traits: CameraTraits, brick: FakeBrick, folder: Path) -> Shares:
    with piloted(traits, brick, folder) as pilot:
        return teach(pilot)
