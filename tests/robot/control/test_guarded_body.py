"""The watchdog on a separate thread is on time, although the loop is late."""

from __future__ import annotations

import math
from typing import Any

import pytest

from robot.control.guarded_body import GuardedBody
from robot.devices.rig import Rig
from robot.driver import ACTION_TIMEOUT_S
from robot.policy.registry import make_policy
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Action, Mode, PilotCommand
from tests.kit.sizes import combined


class Driven:
    """A rig in virtual time, and a pilot who sends a move ten times a second until it vanishes."""

    def __init__(self, mode: Mode, held: Action | None) -> None:
        self.clock = VirtualClock(100.0)
        self.body = FakeDriver(clock=self.clock)
        camera = FakeCamera(self.clock)
        self.rig = Rig(self.body, camera, make_policy("published-8"), self.clock)
        self.loop, self.mode, self.held = self.rig.loop, mode, held
        self.said_s = 0.0

    def drive(self) -> None:
        """Teach the robot to go forward, and then drive in this mode."""
        self.clock.sleep(0.2)
        for mode, held in ((Mode.TRAIN, Action.FORWARD), (self.mode, self.held)):
            assert self.clock.result(self.loop.set_mode(mode), 1.0)
            self.say(held, beats=10)
        assert self.body.now is Action.FORWARD

    def say(self, held: Action | None, beats: int) -> None:
        for _ in range(beats):
            self.said_s = self.clock.now_s()
            self.loop.command(
                PilotCommand(
                    held=held,
                    frame_id=self.loop.state.frame_id,
                    seq=1,
                    received_s=self.said_s,
                )
            )
            self.clock.sleep(0.1)

    def moves_until(self, for_s: float = 3.0) -> float:
        """Let time pass; return the time from the pilot's last message to the last motion of a
        wheel."""
        last_s = 0.0
        end_s = self.clock.now_s() + for_s
        while self.clock.now_s() < end_s:
            if self.body.now is not Action.STOP:
                last_s = self.clock.now_s() - self.said_s
            self.clock.sleep(0.005)
        return last_s


DRIVEN = ["train", "autonomous", "hand in autonomous"]


@pytest.fixture(params=DRIVEN)
def driven(request):
    mode = Mode.TRAIN if request.param == "train" else Mode.AUTONOMOUS
    one = Driven(mode, None if request.param == "autonomous" else Action.FORWARD)
    with one.rig:
        one.drive()
        yield one


@pytest.mark.parametrize(
    ("driven", "where", "held_up_s", "silent_s"),
    combined(DRIVEN, ["propose", "listener", "sense"], [0.1, 0.15, 0.29, 2.0], [0.0, 0.05, 0.18]),
    indirect=["driven"],
)
def test_the_body_stops_on_time_although_the_loop_is_late(driven, where, held_up_s, silent_s):
    driven.clock.sleep(silent_s)
    policy: Any = driven.loop.history.policy
    is_held_up = False

    def hold_up(*_):
        nonlocal is_held_up
        if not is_held_up:
            is_held_up = True
            driven.clock.sleep(held_up_s)

    def before(owner, name):
        original = getattr(owner, name)

        def late(*args, **named):
            hold_up()
            return original(*args, **named)

        setattr(owner, name, late)

    if where == "listener":
        driven.loop.subscribe(hold_up)
    else:
        before(policy if where == "propose" else driven.body, where)
    limit_s = 0.46 if where != "sense" else 0.3 + ACTION_TIMEOUT_S  # the body ends the move
    assert driven.moves_until() <= limit_s
    assert driven.loop.state.decision.mode is Mode.STOPPED


def test_a_pilot_who_sends_commands_drives_on_although_ticks_are_late(driven):
    driven.loop.subscribe(lambda tick: driven.clock.sleep(0.08))
    before = len([one for one in driven.body.changes if one[1] is Action.STOP])
    driven.say(driven.held, beats=30)
    assert driven.body.now is Action.FORWARD
    assert len([one for one in driven.body.changes if one[1] is Action.STOP]) == before
    assert not driven.loop.state.stops


@pytest.mark.parametrize("hangs_s", [0.0, 60.0])
def test_the_watchdog_ends_at_once_or_after_five_seconds_if_the_body_hangs(hangs_s, monkeypatch):
    clock = VirtualClock()
    driver = FakeDriver(clock=clock)
    monkeypatch.setattr(driver, "stop", lambda: clock.sleep(hangs_s))
    with GuardedBody(driver, clock) as body:
        assert body.order(math.inf) and not body._sooner.is_set(), "no deadline is set"
        assert not body.order(0.0), "the deadline has passed"
        assert body.order(0.5)
        clock.sleep(1.0)
    assert clock.now_s() == 1.0 + min(hangs_s, 5.0)
