"""Requests of other threads to the control loop, and the button on the body."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import pytest

from robot.control.cycle import Mailbox
from robot.control.state import LinkLevel, Tick
from robot.driver import BodyButton
from robot.types import Action, DrivenBy, Mode, StopReason
from tests.kit.sizes import crossed
from tests.robot.bench_robot import BenchRobot, started

F = Action.FORWARD
MOVING = (Mode.TRAIN, Mode.AUTONOMOUS)


# Requests ---------------------------------------------------------------------------------------


def leave(robot: BenchRobot) -> None:
    robot.hold(F)  # a waiting request is dropped, too
    robot.loop.empty_command()


def be_silent(robot: BenchRobot) -> None:
    for _ in range(9):
        robot.clock.advance(0.05)
        robot.camera.show(1)
        robot.tick()


def start_late(robot: BenchRobot) -> None:
    robot.loop.set_mode(Mode.TRAIN, proven_s=robot.clock.now_s() - 0.31)


def press(robot: BenchRobot, button: BodyButton) -> None:
    robot.driver.button = button


STOPS: dict[str, tuple[Callable[[BenchRobot], object], StopReason]] = {
    "page": (lambda robot: robot.loop.set_mode(Mode.STOPPED), StopReason.PILOT_ASKED),
    "fault": (lambda robot: robot.loop.trip(StopReason.DRIVE_FAULT), StopReason.DRIVE_FAULT),
    "gone": (leave, StopReason.PILOT_GONE),
    "emergency": (lambda robot: robot.loop.latch_emergency(), StopReason.EMERGENCY),
    "button": (lambda robot: press(robot, BodyButton.STOP), StopReason.BUTTON),
    "start button": (lambda robot: press(robot, BodyButton.START), StopReason.BUTTON),
    "silence": (be_silent, StopReason.PILOT_SILENT),
    "late start": (start_late, StopReason.LINK_SLOW),
}


@pytest.mark.parametrize("mode", MOVING)
@pytest.mark.parametrize(("stop", "reason"), STOPS.values(), ids=STOPS)
def test_a_stop_ends_the_drive_is_counted_once_and_drops_what_was_held(stop, reason, mode):
    robot = started(mode)
    robot.step(1, F)
    drives_before = robot.loop.history.drives
    stop(robot)
    robot.camera.show(1)
    tick = robot.tick()
    assert (tick.sent, tick.decision.mode) == (Action.STOP, Mode.STOPPED)
    assert (tick.decision.driven_by, tick.decision.stop_reason) == (DrivenBy.NOBODY, reason)
    assert robot.loop.mode is Mode.STOPPED
    assert robot.loop.state.stops == {reason: 1}
    assert robot.loop.history.drives == drives_before + 1
    robot.step(1, F)
    assert robot.loop.state.stops == {reason: 1}
    robot.loop.release_emergency()
    robot.tick()
    robot.hold(F)
    robot.start(Mode.TRAIN, scene=1)
    assert robot.driver.sent[-1][0] is Action.STOP, "a command from before the start is not obeyed"
    assert robot.step(1, F).sent is F
    assert robot.loop.state.taught == {F: 3}, "nothing is learned between the two drives"


@pytest.mark.parametrize("waits_s", [0.3, 0.31])
def test_a_start_that_waited_too_long_is_refused_and_a_robot_that_stood_is_not_stopped(waits_s):
    robot = BenchRobot()
    taken = robot.loop.set_mode(Mode.TRAIN)
    robot.clock.advance(waits_s - 1e-6)
    robot.camera.show(1)
    robot.tick()
    assert taken.result(0) is (waits_s == 0.3)
    assert robot.loop.state.stops == {}
    assert robot.loop.state.decision.stop_reason is (
        None if taken.result(0) else StopReason.LINK_SLOW
    )


def test_an_emergency_stop_overtakes_all_earlier_requests():
    robot = started()
    modes: list[Mode] = []
    robot.loop.submit(lambda: modes.append(robot.loop.mode))
    robot.loop.release_emergency()
    refused = robot.loop.set_mode(Mode.TRAIN)
    robot.loop.latch_emergency()
    stopped = robot.loop.set_mode(Mode.STOPPED)
    robot.tick()
    assert robot.driver.stops == 1
    assert stopped.result(0) is True, "a stop is always accepted"
    assert modes == [Mode.STOPPED]
    assert refused.result(0) is False
    assert robot.loop.state.emergency
    robot.loop.release_emergency()
    robot.tick()
    assert not robot.loop.state.emergency


def pressed(robot: BenchRobot, button: BodyButton) -> Tick:
    press(robot, button)
    robot.camera.show(1)
    return robot.tick()


def test_the_start_button_starts_in_the_last_mode():
    robot = BenchRobot()
    assert pressed(robot, BodyButton.STOP).decision.stop_reason is None, "the robot already stood"
    assert robot.loop.state.stops == {}
    assert pressed(robot, BodyButton.START).decision.mode is Mode.TRAIN, "training is the default"
    robot = started(Mode.AUTONOMOUS)
    assert pressed(robot, BodyButton.STOP).decision.mode is Mode.STOPPED
    assert robot.tick().decision.mode is Mode.STOPPED
    assert pressed(robot, BodyButton.START).decision.mode is Mode.AUTONOMOUS
    assert robot.tick().decision.mode is Mode.AUTONOMOUS
    robot.loop.latch_emergency()
    robot.tick()
    robot.loop.release_emergency()
    assert pressed(robot, BodyButton.START).decision.mode is Mode.STOPPED, "the release came later"
    assert pressed(robot, BodyButton.START).decision.mode is Mode.AUTONOMOUS


@crossed(mode=MOVING, stop=["page", "gone", "held up", "emergency"])
def test_a_button_that_meets_a_moving_robot_never_starts_it(stop, mode):
    robot = started(mode)
    robot.step(1, F)
    if stop == "held up":
        robot.clock.advance(1.0)
    else:
        STOPS[stop][0](robot)
        robot.loop.release_emergency()
    assert pressed(robot, BodyButton.START).sent is Action.STOP
    assert robot.tick().decision.mode is Mode.STOPPED
    assert pressed(robot, BodyButton.START).decision.mode is mode


def test_the_links_history_starts_anew_with_another_pilot():
    robot = BenchRobot()
    seen = robot.camera.show(1)
    robot.tick()
    robot.clock.advance(0.27)
    robot.hold(F, frame_id=seen.frame_id)
    robot.start(Mode.TRAIN)  # this request overtakes the command, which still measures the link
    assert robot.loop.state.link.level is LinkLevel.CAPPED
    robot.hold(F, frame_id=seen.frame_id)
    robot.loop.empty_command()
    robot.tick()
    assert (robot.loop.state.link.level, robot.loop.state.link.age_s) == (LinkLevel.GOOD, None)


@pytest.mark.parametrize(("age_s", "mode"), [(None, Mode.TRAIN), (0.4, Mode.TRAIN), (0.6, None)])
def test_a_start_proves_that_the_pilot_sees_the_picture_that_it_names(age_s, mode):
    robot = started()
    robot.loop.set_mode(Mode.STOPPED)
    seen = robot.camera.show(1)
    robot.tick()
    robot.clock.advance(5.0 if age_s is None else age_s)
    robot.camera.show(1)
    taken = robot.loop.set_mode(Mode.TRAIN, frame_id=None if age_s is None else seen.frame_id)
    decision = robot.tick().decision
    assert taken.result(0)
    assert decision.mode is (mode or Mode.STOPPED)
    assert decision.stop_reason is (None if mode else StopReason.LINK_SLOW)


def test_no_request_between_threads_is_lost_or_doubled():
    box, ran = Mailbox(), []

    def fill(first):
        for number in range(first, first + 500):
            box.put(partial(ran.append, number))

    threads = [threading.Thread(target=fill, args=(first,)) for first in (0, 1000, 2000)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        box.serve()
    box.serve()
    assert len(set(ran)) == len(ran) == 1500


def test_requests_run_once_in_order_an_urgent_one_first_and_answer_their_asker():
    box, ran = Mailbox(), []
    first = box.put(lambda: ran.append("first"))
    second = box.put(lambda: "answer")
    outer = box.put(lambda: box.put(lambda: 1 // 0))  # makes another request, which fails
    given_up = box.put(lambda: ran.append("given up"))
    assert given_up.cancel()
    box.put(lambda: ran.append("urgent"), is_urgent=True)
    assert box.wake.is_set() and not first.done()
    for _ in range(2):
        box.serve()
        assert ran == ["urgent", "first"]
        assert not second.done(), "the turn is not over yet"
        assert not second.cancel(), "the function has already run"
    box.answer()
    assert first.done() and second.result(0) == "answer"
    with pytest.raises(ZeroDivisionError):
        outer.result(0).result(0)
