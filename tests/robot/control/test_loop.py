"""The control loop on the test bench: driving, learning, and its answers."""

from __future__ import annotations

from typing import Any

import pytest

from robot.learner.base import Evidence, Vector
from robot.learner.classifier import BSOCClassifier
from robot.policy.features import GreyFeatures
from robot.policy.policy import Policy
from robot.policy.undo import undo_examples
from robot.types import Action, DrivenBy, Mode, Point, Prediction, StopReason
from tests.robot.bench_robot import BenchRobot

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def test_it_drives_what_is_held_and_learns_the_frame_the_pilot_saw() -> None:
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    tick = robot.step(scene=1, held=L)
    assert robot.driver.sent[-1] == (L, 1.0)
    assert tick.decision.driven_by is DrivenBy.PILOT
    assert robot.loop.state.taught == {L: 1}


def test_a_request_is_answered_after_the_state_was_published_to_all_listeners() -> None:
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    robot.step(scene=1, held=L)
    found: list[tuple[int, int]] = []
    told: list[int] = []
    robot.loop.subscribe(lambda tick: told.append(len(tick.history_events)))
    undone = robot.loop.submit(lambda: undo_examples(robot.loop.history, 5.0))
    undone.add_done_callback(
        lambda _: found.append((sum(robot.loop.state.taught.values()), sum(told)))
    )
    robot.tick()
    assert found == [(0, 1)]


def test_a_request_in_the_tick_of_a_start_knows_that_the_robot_drives() -> None:
    robot = BenchRobot()
    robot.camera.show(0)
    robot.loop.set_mode(Mode.TRAIN)
    mode = robot.loop.submit(lambda: robot.loop.mode)
    robot.tick()
    assert mode.result(0) is Mode.TRAIN


def test_a_tick_that_fails_still_answers_its_requests() -> None:
    robot = BenchRobot()
    robot.camera.show_rubbish()
    answer = robot.loop.submit(lambda: "answer")
    robot.tick()
    assert answer.result(0) == "answer"


def test_the_robot_drives_as_it_was_taught_and_learns_from_a_correction() -> None:
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    for _ in range(3):
        robot.step(1, F)
        robot.step(2, L)
    robot.start(Mode.AUTONOMOUS, scene=1)
    assert robot.step(1, None).decision.driven_by is DrivenBy.ROBOT
    assert robot.driver.sent[-1][0] is F
    taught_before = robot.loop.state.taught[L]
    tick = robot.step(2, L)
    assert tick.decision.driven_by is DrivenBy.PILOT
    assert tick.history_events[0].example.is_intervention
    assert robot.loop.state.taught[L] == taught_before + 1
    assert robot.step(1, None).decision.driven_by is DrivenBy.ROBOT


def robot_that_drives(pushes_s: float = 0.0) -> BenchRobot:
    """A robot that was taught four views, LEFT at the first, and now drives by itself.

    Three times its pilot went on for `pushes_s` although the picture did not change.
    """
    robot = BenchRobot("default-8")
    robot.start(Mode.TRAIN)
    for step in range(40):
        robot.step(step % 4, L if step % 4 == 0 else F)
    for _ in range(3 if pushes_s else 0):
        for _ in range(round(pushes_s / 0.05)):
            robot.step(1, F)
        for step in range(8):
            robot.step(step % 4, L if step % 4 == 0 else F)
    robot.start(Mode.AUTONOMOUS, scene=1)
    for step in range(40):
        robot.step(step % 4, None)
    return robot


def test_a_stuck_robot_tries_another_move_within_a_second() -> None:
    robot = robot_that_drives()
    unlike_all_lessons = 98
    sent = [robot.step(unlike_all_lessons, None).sent for _ in range(40)]  # for two seconds
    assert sent[5] is F
    assert L in sent[5:20]


def test_a_robot_whose_pilot_pushes_goes_on_pushing() -> None:
    robot = robot_that_drives(pushes_s=2.2)
    assert {robot.step(1, None).sent for _ in range(60)} == {F}


def test_a_robot_gives_up_pushing_on_the_most_familiar_view_if_its_pilot_never_pushed() -> None:
    robot = robot_that_drives()
    assert L in {robot.step(1, None).sent for _ in range(20)}


def test_a_robot_that_stays_stuck_asks_and_drives_on_after_a_correction() -> None:
    robot = robot_that_drives()
    ticks = [robot.step(1, None) for _ in range(round(40 / 0.05))]
    asking = [tick for tick in ticks if tick.decision.stop_reason is StopReason.NEEDS_HELP]
    assert asking and all(tick.sent is Action.STOP for tick in asking)
    assert all(tick.decision.mode is Mode.AUTONOMOUS for tick in ticks)
    while robot.step(1, None).decision.stop_reason is not StopReason.NEEDS_HELP:
        pass
    assert robot.step(2, L).decision.driven_by is DrivenBy.PILOT
    assert robot.step(2, None).decision.stop_reason is None
    assert robot.driver.sent[-1][0] in (F, L)


def test_the_pilots_move_does_not_affect_the_robots_prediction() -> None:
    robot = BenchRobot("default-8")
    robot.start(Mode.TRAIN)
    for _ in range(20):
        robot.step(1, F)
        robot.step(2, L)
    under_way: list[Action | None] = []
    propose = robot.loop.history.policy.propose

    def listen(frame_id: int, x: Any, **drive: Any) -> Prediction:
        under_way.append(drive["under_way"])
        return propose(frame_id, x, **drive)

    robot.loop.history.policy.propose = listen  # type: ignore[method-assign]
    robot.step(1, F)
    robot.step(1, F)
    assert under_way == [None, None]
    robot.start(Mode.AUTONOMOUS, scene=1)
    robot.step(1, None)
    robot.step(1, None)
    assert under_way[-1] is F
    robot.step(1, L)
    robot.step(1, L)
    assert under_way[-1] is None


def test_agreement_counts_predictions_made_before_the_example_was_learned() -> None:
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    robot.step(1, F)
    assert robot.loop.state.agreement == 0.0
    for _ in range(9):
        robot.step(1, F)
    assert robot.loop.state.agreement == pytest.approx(0.9)


def test_listeners_get_every_tick_until_they_unsubscribe() -> None:
    robot = BenchRobot()
    heard: list[int] = []
    leave = robot.loop.subscribe(lambda tick: heard.append(1))
    robot.tick()
    leave()
    robot.tick()
    assert len(heard) == 1


class FailingLearner(BSOCClassifier):
    """Fails on request, in every way in which a learner can fail."""

    is_failing = True

    def explain_one(self, x: Vector) -> Evidence:
        if self.is_failing:
            raise RuntimeError("out of order")
        return super().explain_one(x)

    def learn_one(self, x: Vector, y: str) -> None:
        if self.is_failing:
            raise ArithmeticError("no such thing")
        super().learn_one(x, y)

    def reset(self) -> None:
        if self.is_failing:
            raise OSError("lost")


def test_a_learner_that_fails_proposes_nothing_and_does_not_stop_the_robot() -> None:
    learner = FailingLearner.published(4)
    robot = BenchRobot(Policy("published-4", 4, learner, GreyFeatures()))
    robot.start(Mode.TRAIN)
    for _ in range(3):
        tick = robot.step(scene=1, held=L, seconds=0.12)
        assert robot.driver.sent[-1] == (L, 1.0), "the pilot drives all the same"
        assert tick.prediction is not None and tick.prediction.action is None
        assert "The learner failed" in (robot.loop.state.fault or "")
    assert robot.loop.state.n_nodes == 0
    robot.start(Mode.AUTONOMOUS)
    assert robot.step(scene=1, held=None).decision.asks_pilot
    learner.is_failing = False
    robot.start(Mode.TRAIN)
    robot.step(scene=1, held=L)
    assert robot.step(scene=1, held=L).prediction.action is L
    assert robot.loop.state.fault is None
    assert robot.loop.learning.failure is not None, "it is not forgotten"


@pytest.mark.parametrize("takes_points", [True, False])
def test_degrees_reach_a_body_that_takes_them_and_are_a_move_to_any_other(
    takes_points: bool,
) -> None:
    robot = BenchRobot()
    robot.driver.takes_points = takes_points
    robot.start(Mode.TRAIN)
    point = Point(-0.4, 0.3)
    robot.camera.show(1)
    robot.hold(L, point=point)
    tick = robot.tick()
    assert (tick.sent, tick.decision.point) == (L, point)
    assert robot.driver.point == (point if takes_points else None)
    assert robot.loop.state.taught == {L: 1}
    robot.loop.latch_emergency()
    robot.tick()
    assert robot.driver.now is Action.STOP and robot.driver.point is None
