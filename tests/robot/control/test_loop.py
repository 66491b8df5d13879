"""The control loop on the test bench: driving, learning, its answers, and its ticks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robot.control.config import LoopConfig
from robot.control.state import Timing
from robot.learner.base import Evidence, Vector
from robot.learner.classifier import BSOCClassifier
from robot.policy.features import GreyFeatures
from robot.policy.policy import Policy
from robot.policy.undo import undo_examples
from robot.types import Action, DrivenBy, Mode, Point, StopReason
from tests.kit.sizes import crossed
from tests.robot.bench_robot import BenchRobot, started

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def test_a_request_is_answered_after_the_state_was_published_to_all_listeners():
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    robot.step(scene=1, held=L)
    found: list[tuple[int, int]] = []
    told: list[int] = []
    leave = robot.loop.subscribe(lambda tick: told.append(len(tick.history_events)))
    undone = robot.loop.submit(lambda: undo_examples(robot.loop.history, 5.0))
    undone.add_done_callback(
        lambda _: found.append((sum(robot.loop.state.taught.values()), sum(told)))
    )
    robot.tick()
    assert found == [(0, 1)]
    leave()
    robot.tick()
    assert told == [1]


def test_a_request_in_the_tick_of_a_start_knows_the_mode_even_if_the_tick_fails():
    robot = BenchRobot()
    robot.camera.show_rubbish()
    robot.loop.set_mode(Mode.TRAIN)
    mode = robot.loop.submit(lambda: robot.loop.mode)
    robot.tick()
    assert mode.result(0) is Mode.TRAIN


def test_the_robot_drives_as_it_was_taught_and_learns_from_a_correction():
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    for _ in range(3):
        robot.step(1, F)
        tick = robot.step(2, L)
        assert not tick.history_events[0].example.is_intervention
    robot.start(Mode.AUTONOMOUS, scene=1)
    assert robot.step(1, None).decision.driven_by is DrivenBy.ROBOT
    assert robot.driver.sent[-1][0] is F
    taught_before = robot.loop.state.taught[L]
    tick = robot.step(2, L)
    assert tick.decision.driven_by is DrivenBy.PILOT
    assert tick.history_events[0].example.is_intervention
    assert robot.loop.state.taught[L] == taught_before + 1
    assert robot.step(1, None).decision.driven_by is DrivenBy.ROBOT


def test_a_stuck_robot_tries_another_move_asks_and_drives_on_after_a_correction():
    """Four views were taught, with LEFT at the first one; then the picture stays the same."""
    robot = BenchRobot("default-8")
    robot.start(Mode.TRAIN)
    for step in range(40):
        robot.step(step % 4, L if step % 4 == 0 else F)
    robot.start(Mode.AUTONOMOUS, scene=1)
    for step in range(40):
        robot.step(step % 4, None)
    ticks = [robot.step(1, None) for _ in range(round(40 / 0.05))]
    sent = [tick.sent for tick in ticks]
    assert set(sent[:5]) == {F} and L in sent[:20], "the robot turns within a second"
    asking = [tick for tick in ticks if tick.decision.stop_reason is StopReason.NEEDS_HELP]
    assert asking and all(tick.sent is Action.STOP for tick in asking)
    assert all(tick.decision.mode is Mode.AUTONOMOUS for tick in ticks)
    while robot.step(1, None).decision.stop_reason is not StopReason.NEEDS_HELP:
        pass
    assert robot.step(2, L).decision.driven_by is DrivenBy.PILOT
    assert robot.step(2, None).decision.stop_reason is None
    assert robot.driver.sent[-1][0] in (F, L)


def test_the_pilots_move_does_not_affect_the_robots_prediction():
    robot = BenchRobot("default-8")
    robot.start(Mode.TRAIN)
    for _ in range(20):
        robot.step(1, F)
        robot.step(2, L)
    under_way: list[Action | None] = []
    propose = robot.loop.history.policy.propose

    def listen(frame_id, x, **drive):
        under_way.append(drive["under_way"])
        return propose(frame_id, x, **drive)

    robot.loop.history.policy.propose = listen
    robot.step(1, F)
    robot.step(1, F)
    robot.start(Mode.AUTONOMOUS, scene=1)
    for held in (None, None, L, L):
        robot.step(1, held)
    assert under_way[:2] == [None, None]
    assert under_way[-3:] == [F, F, None]


def test_agreement_counts_predictions_made_before_the_example_was_learned():
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    robot.step(1, F)
    assert robot.loop.state.agreement == 0.0
    for _ in range(9):
        robot.step(1, F)
    assert robot.loop.state.agreement == pytest.approx(0.9)


class FailingLearner(BSOCClassifier):
    """A learner that, on request, fails in every possible way."""

    is_failing = True

    def explain_one(self, x: Vector) -> Evidence:
        if self.is_failing:
            raise RuntimeError("out of order")
        return super().explain_one(x)

    def learn_one(self, x: Vector, y: str) -> None:
        if self.is_failing:
            raise ArithmeticError("no such thing, " * 30)
        super().learn_one(x, y)

    def reset(self) -> None:
        if self.is_failing:
            raise OSError("lost")


def test_a_learner_that_fails_proposes_nothing_and_does_not_stop_the_robot(caplog):
    learner = FailingLearner.published(4)
    robot = BenchRobot(Policy("published-4", 4, learner, GreyFeatures()))
    for scene in range(3):
        robot.step(scene, None)
    assert caplog.messages == ["the learner failed"]
    robot.start(Mode.TRAIN)
    for _ in range(3):
        tick = robot.step(scene=1, held=L, seconds=0.12)
        assert robot.driver.sent[-1] == (L, 1.0), "the pilot can still drive"
        assert tick.prediction is not None and tick.prediction.action is None
        fault = robot.loop.state.fault or ""
        assert "The learner failed and proposes no move: no such thing" in fault
        assert len(fault) == 300, "the text is cut off after 300 characters"
    assert robot.loop.state.n_nodes == 0
    robot.start(Mode.AUTONOMOUS)
    assert robot.step(scene=1, held=None).decision.asks_pilot
    learner.is_failing = False
    robot.start(Mode.TRAIN)
    robot.step(scene=1, held=L)
    assert robot.step(scene=1, held=L).prediction.action is L
    assert robot.loop.state.fault is None
    assert robot.loop.learning.failure is not None, "the failure stays on record"


@pytest.mark.parametrize("takes_points", [True, False])
def test_a_held_point_is_driven_and_learned_if_the_body_accepts_points(takes_points):
    robot = BenchRobot()
    robot.driver.takes_points = takes_points
    robot.start(Mode.TRAIN)
    point = Point(-0.4, 0.3)
    tick = robot.step(scene=1, held=L, point=point)
    assert robot.driver.sent[-1] == (L, 1.0) and tick.sent is L
    assert (tick.decision.driven_by, tick.decision.point) == (DrivenBy.PILOT, point)
    assert robot.driver.point == (point if takes_points else None)
    assert robot.loop.state.taught == {L: 1}
    robot.loop.latch_emergency()
    robot.tick()
    assert robot.driver.now is Action.STOP and robot.driver.point is None


def hold_up(monkeypatch: pytest.MonkeyPatch, robot: BenchRobot, seconds: float) -> None:
    """Make each prediction of the policy take this long."""
    policy = robot.loop.history.policy
    propose = policy.propose

    def slow(*args: Any, **kwargs: Any) -> Any:
        robot.clock.advance(seconds)
        return propose(*args, **kwargs)

    monkeypatch.setattr(policy, "propose", slow)


# When ticks run, and their state ---------------------------------------------------------------


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
def test_every_event_wakes_the_loop(happens):
    robot = BenchRobot()
    assert not robot.loop.wake.is_set()
    happens(robot)
    assert robot.loop.wake.is_set()


@pytest.mark.parametrize(
    ("period_s", "before", "mode", "wakes"),
    [
        (1 / 16, Mode.STOPPED, Mode.TRAIN, False),
        (1 / 8, Mode.STOPPED, Mode.TRAIN, True),
        (1 / 8, Mode.STOPPED, Mode.STOPPED, False),
        (1 / 8, Mode.TRAIN, Mode.TRAIN, False),  # the gap grows slowly while the robot may move
    ],
)
def test_a_repeated_command_wakes_only_a_loop_that_ticks_seldom(period_s, before, mode, wakes):
    robot = BenchRobot(config=LoopConfig(longest_wait_s=1 / 16))
    robot.loop.set_mode(before)
    for scene in range(3):
        robot.clock.advance(period_s)
        robot.camera.show(scene)
        robot.tick()
    robot.loop.set_mode(mode)
    for is_set in (True, wakes):
        robot.tick()
        robot.loop.wake.clear()
        robot.hold(F)
        assert robot.loop.wake.is_set() is is_set


def test_a_robot_at_rest_takes_only_the_pictures_that_are_needed(monkeypatch):
    robot, taken, waits_s, rests = BenchRobot(), list[int](), list[float](), list[float]()
    monkeypatch.setattr(robot.camera, "rest", rests.append)
    robot.loop.need_picture_every(0.5)
    for number in range(1, 64):
        assert robot.loop.state.is_resting is (number > 16)
        robot.clock.advance(1 / 16)
        robot.camera.show(number)
        if robot.tick().frame:
            taken.append(number)
        waits_s.append(robot.loop.wait_s)
    assert taken == [*range(1, 17), *range(24, 64, 8)]
    assert waits_s == [0.05] * 15 + [0.25] * 48
    robot.loop.set_mode(Mode.TRAIN)
    for number in range(2):
        robot.clock.advance(1 / 16)
        robot.camera.show(number)
        robot.tick()
    assert robot.loop.state.cycle_hz == 16.0, "the rest does not count in the camera's rate"
    assert rests == [0.5, 0.0] and not robot.loop.state.is_resting


def test_the_loop_ticks_when_the_pilot_becomes_blind():
    robot, waits_s = started(), list[float]()
    for _ in range(10):
        robot.clock.advance(0.05)
        waits_s.append(robot.loop.wait_s)
    assert waits_s == pytest.approx([0.05] * 8 + [0.01, 0.001])


def test_a_new_frame_is_shown_once_with_what_the_policy_made_of_it():
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


def test_the_body_shows_each_change_of_the_mode_once():
    robot = started()
    robot.step(1, F)
    robot.loop.set_mode(Mode.STOPPED)
    robot.tick()
    robot.tick()
    assert robot.driver.shown == [Mode.TRAIN, Mode.STOPPED]


@pytest.mark.parametrize(("seconds", "late_cycles"), [(0.09, 0), (0.11, 1)])
def test_a_tick_that_takes_longer_than_a_tenth_of_a_second_is_late(
    monkeypatch, seconds, late_cycles
):
    robot = BenchRobot()
    hold_up(monkeypatch, robot, seconds)
    robot.camera.show(1)
    assert robot.tick().cycle_s == pytest.approx(seconds)
    assert (robot.loop.state.cycles, robot.loop.state.late_cycles) == (1, late_cycles)
    assert robot.loop.state.learner_times["propose"] == Timing(1, pytest.approx(seconds))


# The limits of a tick ---------------------------------------------------------------------------


@pytest.mark.parametrize(("gap_s", "stops"), [(0.25, False), (0.2501, True)])
def test_a_longer_gap_between_two_ticks_than_allowed_stops_the_robot(gap_s, stops):
    robot = BenchRobot(config=LoopConfig(stall_s=0.25))
    robot.clock.advance(60.0)
    assert robot.tick().fault is None, "a gap does not matter while the robot stands"
    robot.start(Mode.TRAIN)
    robot.clock.advance(gap_s)
    robot.camera.show(1)
    robot.hold(F)
    decision = robot.tick().decision
    assert (decision.stop_reason is StopReason.LOOP_FAULT) is stops
    assert (decision.action is F) is not stops


@crossed(share=[1.0, 0.5], link=[(0.1, 1.0, True), (0.27, 0.5, True), (0.35, 0.5, False)])
def test_a_person_and_the_link_each_limit_the_speed_and_a_slow_link_ends_learning(share, link):
    age_s, scale, learns = link
    robot = BenchRobot()
    robot.loop.speed_share = share
    assert robot.loop.speed_share == share
    robot.start(Mode.AUTONOMOUS)
    seen = robot.camera.show(1)
    robot.tick()
    for _ in range(2):
        robot.clock.advance(age_s / 2)
        robot.camera.show(1)
        robot.tick()
    robot.hold(F, frame_id=seen.frame_id)
    tick = robot.tick()
    assert robot.driver.sent[-1] == (F, share * scale)
    assert bool(tick.taught) is learns


def test_a_pilot_whose_phone_shows_a_picture_half_a_second_old_drives_no_more():
    robot = started()
    seen = robot.camera.latest()
    assert seen is not None
    for tick in range(1, 12):
        robot.clock.advance(0.05)
        robot.camera.show(1)
        robot.hold(F, seen.frame_id, frame_age_s=0.05 * tick, phone_s=0.05 * tick)
        decision = robot.tick().decision  # the correction holds until the next tick
        assert decision.mode is (Mode.TRAIN if tick < 10 else Mode.STOPPED), tick
    assert decision.stop_reason is StopReason.LINK_SLOW
    assert robot.loop.state.fault is None
