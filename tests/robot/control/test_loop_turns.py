"""The ticks of the control loop: what causes them, what they show, and their limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from robot.control.config import LoopConfig
from robot.control.state import LinkLevel
from robot.types import Action, Mode, StopReason
from tests.robot.bench_robot import BenchRobot, started

F = Action.FORWARD


def hold_up(monkeypatch: pytest.MonkeyPatch, robot: BenchRobot, seconds: float) -> None:
    """Let each prediction of the policy take this time."""
    policy = robot.loop.history.policy
    propose = policy.propose

    def slow(*args: Any, **kwargs: Any) -> Any:
        robot.clock.advance(seconds)
        return propose(*args, **kwargs)

    monkeypatch.setattr(policy, "propose", slow)


# Causes of ticks, and their state ---------------------------------------------------------------


@pytest.mark.parametrize(
    "happens",
    [
        lambda robot: robot.camera.show(1),
        lambda robot: robot.hold(F),
        lambda robot: robot.loop.submit(lambda: None),
        lambda robot: robot.loop.set_mode(Mode.TRAIN),
        lambda robot: robot.loop.latch_emergency(),
    ],
    ids=["frame", "command", "request", "mode", "emergency"],
)
def test_every_event_wakes_the_loop(happens: Callable[[BenchRobot], object]) -> None:
    robot = BenchRobot()
    assert not robot.loop.wake.is_set()
    happens(robot)
    assert robot.loop.wake.is_set()


def test_without_events_the_loop_runs_every_50_ms() -> None:
    robot = BenchRobot()
    robot.rig.start()
    robot.clock.sleep(1.0)
    robot.rig.stop()
    assert 19 <= robot.loop.state.cycles <= 22


def test_a_new_frame_is_shown_once_with_what_the_policy_made_of_it() -> None:
    robot = BenchRobot()
    assert robot.loop.learning.newest is None
    assert robot.loop.clock is robot.clock
    frame = robot.camera.show(1)
    tick = robot.tick()
    assert tick.frame is frame
    assert tick.sensors.distance_m == 0.5
    assert robot.loop.learning.newest is not None
    x, prediction = robot.loop.learning.newest
    assert np.array_equal(x, robot.loop.history.policy.extract(frame))
    assert prediction is tick.prediction
    assert robot.tick().frame is None


def test_the_body_shows_each_change_of_the_mode_once() -> None:
    robot = started()
    robot.step(1, F)
    robot.loop.set_mode(Mode.STOPPED)
    robot.tick()
    robot.tick()
    assert robot.driver.shown == [Mode.TRAIN, Mode.STOPPED]


@pytest.mark.parametrize(("seconds", "late_cycles"), [(0.09, 0), (0.11, 1)])
def test_a_tick_that_takes_longer_than_a_tenth_of_a_second_is_late(
    monkeypatch: pytest.MonkeyPatch, seconds: float, late_cycles: int
) -> None:
    robot = BenchRobot()
    hold_up(monkeypatch, robot, seconds)
    robot.camera.show(1)
    assert robot.tick().cycle_s == pytest.approx(seconds)
    assert robot.loop.state.late_cycles == late_cycles


# The limits of a tick ---------------------------------------------------------------------------


@pytest.mark.parametrize(("gap_s", "stops"), [(0.25, False), (0.2501, True)])
def test_a_longer_gap_between_two_ticks_than_allowed_stops_the_robot(
    gap_s: float, stops: bool
) -> None:
    robot = BenchRobot(config=LoopConfig(stall_s=0.25))
    robot.start(Mode.TRAIN)
    robot.clock.advance(gap_s)
    robot.camera.show(1)
    robot.hold(F)
    decision = robot.tick().decision
    assert (decision.stop_reason is StopReason.LOOP_FAULT) is stops
    assert (decision.action is F) is not stops


def test_a_gap_between_ticks_does_not_matter_while_the_robot_stands() -> None:
    robot = BenchRobot()
    robot.tick()
    robot.clock.advance(60.0)
    robot.tick()
    assert (robot.loop.state.fault, robot.loop.state.decision.stop_reason) == (None, None)


@pytest.mark.parametrize(("age_s", "link_scale"), [(0.1, 1.0), (0.27, 0.5)])
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_person_and_the_link_each_limit_the_speed(
    age_s: float, link_scale: float, share: float
) -> None:
    robot = BenchRobot()
    robot.loop.speed_share = share
    robot.start(Mode.TRAIN)
    seen = robot.camera.show(1)
    robot.tick()
    robot.clock.advance(age_s)
    robot.camera.show(1)
    robot.hold(F, frame_id=seen.frame_id)
    robot.tick()
    assert robot.driver.sent[-1] == (F, share * link_scale)


@pytest.mark.parametrize(
    ("phone_s", "level"), [(None, LinkLevel.GOOD), (0.0, LinkLevel.CAPPED), (0.2, LinkLevel.GOOD)]
)
def test_a_slow_cameras_period_is_allowed_for_unless_the_page_tells_what_its_phone_took(
    phone_s: float | None, level: LinkLevel
) -> None:
    robot = BenchRobot()
    for _ in range(9):  # five pictures a second
        robot.clock.advance(0.2)
        seen = robot.camera.show(1)
        robot.tick()
    robot.clock.advance(0.28)
    robot.hold(None, seen.frame_id, frame_age_s=0.28, phone_s=phone_s)
    robot.tick()
    assert robot.loop.state.link.level is level


def test_a_pilot_whose_phone_shows_a_picture_half_a_second_old_drives_no_more() -> None:
    robot = started()
    seen = robot.camera.latest()
    assert seen is not None
    for tick in range(1, 12):
        robot.clock.advance(0.05)
        robot.camera.show(1)
        robot.hold(F, seen.frame_id, frame_age_s=0.05 * tick, phone_s=0.05 * tick)
        decision = robot.tick().decision  # holds until the next tick
        assert decision.mode is (Mode.TRAIN if tick < 10 else Mode.STOPPED), tick
    assert decision.stop_reason is StopReason.LINK_SLOW
    assert robot.loop.state.fault is None
