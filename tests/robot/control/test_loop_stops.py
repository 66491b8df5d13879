"""The control loop on the test bench: each reason of a stop, and its message."""

from __future__ import annotations

import json
import logging
import math
import random
from dataclasses import asdict
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from robot.control.state import STEADY_S, SteadyFault, Tick
from robot.driver import Pose, Sensors
from robot.errors import DriveError
from robot.types import Action, Mode, StopReason
from tests.robot.bench_robot import BenchRobot, started

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
BROKEN = "the driver of the robot 'bench' failed in "


def explode(*_: object, **__: object) -> None:
    raise ArithmeticError("boom")


@pytest.mark.parametrize("where", ["propose", "send_action"])
def test_a_decision_from_before_a_pause_of_the_process_is_not_driven_after_it(where):
    robot = started()
    owner: Any = robot.loop.history.policy if where == "propose" else robot.driver
    original = getattr(owner, where)

    def held_up(*args, **kwargs):
        answer = original(*args, **kwargs)
        robot.clock.advance(1.0)
        return answer

    moves_before, stops_before = len(robot.driver.sent), robot.driver.stops
    setattr(owner, where, held_up)
    robot.clock.advance(0.05)
    robot.camera.show(1)
    tick = robot.tick()
    assert (tick.sent, tick.decision.stop_reason) == (Action.STOP, StopReason.LOOP_FAULT)
    assert robot.driver.stops > stops_before
    assert len(robot.driver.sent) - moves_before == (1 if where == "send_action" else 0)
    assert "held up for 1.0 s. Close other programs" in (robot.loop.state.fault or "")


@pytest.mark.parametrize("ahead_s", [0.05, 1e9, math.inf, math.nan])
def test_a_silent_camera_whose_clock_is_ahead_stops_the_robot_just_as_soon(ahead_s):
    robot = BenchRobot()
    robot.start(Mode.TRAIN)
    for _ in range(30):
        robot.clock.advance(0.05)
        robot.camera.show(1, captured_s=robot.clock.now_s() + ahead_s)
        robot.hold(F)
        assert robot.tick().sent is F
    for _ in range(5):
        robot.clock.advance(0.05)
        robot.hold(F)
        tick = robot.tick()
    assert (tick.sent, tick.decision.stop_reason) == (Action.STOP, StopReason.FRAME_STALE)


@pytest.mark.parametrize("fault", ["The lens is lost.", OSError("The lens is lost.")])
def test_a_camera_that_reports_a_fault_stops_the_robot_and_is_reported_as_text(fault):
    robot = started()
    robot.camera.show(2)
    robot.camera.fault = fault
    robot.hold(F)
    tick = robot.tick()
    assert (tick.decision.stop_reason, tick.fault) == (StopReason.CAMERA_FAULT, "The lens is lost.")
    assert robot.loop.state.taught == {F: 1}, "the robot does not learn a move that was not driven"


@pytest.mark.parametrize("mode", [None, Mode.TRAIN, Mode.AUTONOMOUS])
def test_a_camera_that_slows_to_a_picture_a_second_is_reported_until_it_is_fast(mode):
    robot = BenchRobot()
    if mode is not None:
        robot.start(mode)

    def film(period_s, pictures):
        said = []
        for scene in range(pictures):
            robot.camera.show(scene % 2)
            for _ in range(round(period_s / 0.05)):
                robot.clock.advance(0.05)
                robot.tick()
            said.append(robot.loop.state.fault)
        return said

    assert not any(film(0.05, 40))
    assert "only one picture every 1.0 s" in (film(1.0, 8)[-1] or "")
    assert film(0.05, 200)[-1] is None


@pytest.mark.parametrize("mode", [Mode.TRAIN, Mode.AUTONOMOUS])
def test_an_invalid_picture_does_not_affect_later_pictures(mode):
    robot = BenchRobot()
    robot.start(mode)
    robot.step(1, F)
    robot.camera.show_rubbish()
    tick = robot.tick()
    assert tick.frame is None and tick.fault is not None
    assert (robot.step(1, F).sent, robot.loop.state.fault) == (F, None)
    for _ in range(6):
        robot.clock.advance(0.05)
        robot.camera.show_rubbish()
        robot.hold(F)
        robot.tick()
    assert robot.loop.state.decision.stop_reason is StopReason.FRAME_STALE
    assert robot.step(1, F).fault is not None, "the fault still says why the robot stopped"
    robot.start(mode, scene=1)
    assert robot.loop.state.fault is None


@pytest.mark.parametrize("can_stop", [True, False])
@pytest.mark.parametrize(
    ("error", "said"),
    [
        (DriveError("No motor on port B."), "No motor on port B."),
        *((KeyError("boom"), BROKEN), (SystemExit("no board"), BROKEN), (GeneratorExit(), BROKEN)),
    ],
    ids=["its own", "any", "an exit", "a generator's end"],
)
@pytest.mark.parametrize("call", ["sense", "send_action", "take_button"])
def test_a_body_that_fails_is_stopped_and_reported_and_nothing_is_learned(
    call, error, said, can_stop
):
    robot = started()
    stops_before = robot.driver.stops

    def fail(*_, **__):
        raise error

    for name in (call,) if can_stop else (call, "stop"):
        setattr(robot.driver, name, fail)
    tick = robot.step(1, F)
    assert (tick.sent, tick.decision.stop_reason) == (Action.STOP, StopReason.DRIVE_FAULT)
    assert (robot.driver.stops > stops_before) is can_stop
    assert said in str(tick.fault) and str(error).strip("'") in str(tick.fault)
    assert (tick.sensors == Sensors()) is (call == "sense")
    assert robot.loop.state.taught == {F: 1}, "the robot does not learn a move that was not driven"


def test_ctrl_c_during_a_tick_stops_the_robot_and_is_raised():
    """An experiment runs its ticks on the main thread, which gets the signal."""
    robot = started()
    stops_before = robot.driver.stops

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    robot.driver.sense = interrupt
    with pytest.raises(KeyboardInterrupt):
        robot.step(1, F)
    assert robot.driver.stops > stops_before


@pytest.mark.parametrize(
    "sense",
    [
        lambda: None,
        lambda: {"distance_m": 0.5},
        lambda: Sensors(distance_m="near"),
        lambda: Sensors(battery_share="near"),
        lambda: Sensors(pose="near"),
        lambda: Sensors(pose=(1.0, 2.0, 0.5)),
        lambda: Sensors(game={"score": 1}),
        lambda: Sensors(bumpers=None),
    ],
)
def test_a_driver_with_a_reading_of_another_type_is_named_and_stopped(sense):
    robot = started()
    robot.driver.sense = sense
    tick = robot.step(1, F)
    assert (tick.sent, tick.decision.stop_reason) == (Action.STOP, StopReason.DRIVE_FAULT)
    assert f"{BROKEN}sense: " in str(tick.fault)
    assert tick.sensors == Sensors(), "the page shows the sensors of the tick"


def test_readings_that_are_not_finite_count_as_missing():
    """Drivers report infinity for an obstacle out of range; JSON has no such number."""
    for none in (math.inf, -math.inf, math.nan):
        lost = Pose(x_m=0.0, y_m=none, heading_rad=0.0)
        assert Sensors(distance_m=none, battery_share=none, pose=lost) == Sensors()
    pose = Pose(x_m=1.0, y_m=2.0, heading_rad=0.5)
    there = Sensors(distance_m=0.5, bumpers=[True, False], pose=pose)
    assert (there.distance_m, there.bumpers, there.pose) == (0.5, (True, False), pose)


def test_readings_in_other_numbers_can_be_sent_and_saved():
    """Drivers may return NumPy numbers or `Decimal`, which JSON does not have."""
    place = Pose(x_m=np.float32(1.0), y_m=np.int64(2), heading_rad=Decimal("0.5"))
    pressed = np.array([True, False])
    read = Sensors(
        distance_m=np.float32(0.5),
        battery_share=Fraction(1, 4),
        bumped=np.bool_(True),
        bumpers=pressed,
        pose=place,
    )
    pose = {"x_m": 1.0, "y_m": 2.0, "heading_rad": 0.5, "is_estimate": False}
    plain = {"distance_m": 0.5, "battery_share": 0.25, "bumped": True, "bumpers": [True, False]}
    assert json.loads(json.dumps(asdict(read))) == {**plain, "pose": pose, "game": None}


def test_a_driver_that_returns_no_action_is_taken_to_do_what_it_was_told():
    robot = started()
    for returned in (None, b"forward", 3):
        robot.driver.send_action = lambda *_, returned=returned, **__: returned
        assert robot.step(1, F).sent is F


@pytest.mark.parametrize("none", [False, "", np.bool_(False)])
def test_a_driver_may_say_false_for_no_button(none):
    robot = started()
    robot.driver.take_button = lambda: none
    assert robot.step(1, F).sent is F


def test_a_body_that_fails_is_stopped_before_it_is_logged_and_is_logged_once(monkeypatch):
    """A log may be slow, because its terminal may be paused."""
    robot = started()
    before, logged = robot.driver.stops, []
    monkeypatch.setattr(
        logging.getLogger("robot.errors"),
        "error",
        lambda said, exc_info: logged.append((robot.driver.stops, type(exc_info))),
    )
    robot.driver.sense = explode
    for scene in range(5):
        robot.step(scene, F)
    assert logged == [(before + 1, ArithmeticError)]


def test_a_stop_that_the_body_cannot_show_is_reported_to_all_listeners():
    robot, told = BenchRobot(), list[Tick]()
    robot.loop.subscribe(told.append)
    robot.start(Mode.TRAIN)
    robot.driver.show = explode
    robot.loop.trip(StopReason.PILOT_GONE)
    for _ in range(2):
        tick = robot.tick()
    assert tick.decision.mode is told[-1].decision.mode is Mode.STOPPED
    assert "failed in show" in str(told[-1].fault) and "boom" in str(told[-1].fault)


def test_an_error_of_a_listener_stops_the_robot_and_is_logged_once(caplog):
    robot = started()
    robot.loop.subscribe(explode)
    for scene in range(3):
        robot.step(scene, F)
    assert robot.loop.mode is Mode.STOPPED and robot.driver.now is Action.STOP
    assert isinstance(robot.loop.error, ArithmeticError)
    assert robot.loop.state.stops == {StopReason.LOOP_FAULT: 1}
    assert caplog.messages.count("the loop stopped the robot") == 1


def test_a_camera_that_cannot_rest_is_reported_and_ends_no_loop():
    robot = BenchRobot()
    robot.camera.rest = explode
    robot.rig.start()
    robot.loop.need_picture_every(1.0)
    robot.clock.sleep(2.0)
    assert "boom" in str(robot.loop.state.fault)
    robot.clock.result(robot.loop.need_picture_every(0.0), 1.0)
    robot.rig.stop()
    robot.start(Mode.TRAIN)
    assert robot.step(1, F).sent is F


@pytest.mark.parametrize("age", ["soon", property(explode)])
def test_a_camera_with_an_age_that_cannot_be_read_is_named_and_stops_the_robot(age):
    robot = started()
    robot.camera.__class__ = type("Broken", (type(robot.camera),), {"source_age_s": age})
    vars(robot.camera).pop("source_age_s")  # so that the class's attribute counts
    for scene in range(20):
        tick = robot.step(scene, F)
    assert tick.sent is Action.STOP and robot.loop.mode is Mode.STOPPED
    assert str(robot.loop.state.fault).startswith("camera 'bench' failed in source_age_s: ")


def test_a_body_that_fails_in_advise_is_named_and_stopped():
    robot = started()
    body: Any = type("Advised", (type(robot.driver),), {"takes_advice": True, "advise": explode})
    robot.driver.__class__ = body
    robot.loop.subscribe(robot.rig._advise)
    robot.step(1, F)
    assert str(robot.step(1, F).fault).startswith(BROKEN + "advise: ArithmeticError")


def test_the_loops_thread_runs_ticks_and_stops_the_robot_at_its_end():
    robot = BenchRobot()
    robot.rig.start()
    assert robot.clock.result(robot.loop.submit(lambda: "served"), 5.0) == "served"
    cycles = robot.loop.state.cycles
    robot.clock.sleep(1.0)
    assert 19 <= robot.loop.state.cycles - cycles <= 22, "the loop ticks every 50 ms without events"
    robot.rig.stop()
    robot.rig.stop()
    assert robot.driver.sent[-1][0] is Action.STOP


def test_a_fault_is_shown_at_once_and_goes_when_it_is_over():
    steady = SteadyFault()
    assert steady.show("the hub is lost", 0.0, may_move=False) == "the hub is lost"
    assert steady.show(None, 1.0, may_move=False) == "the hub is lost"
    assert steady.show(None, STEADY_S, may_move=False) is None
    assert steady.show("again", STEADY_S, may_move=False) == "again"
    assert steady.show(None, STEADY_S + 0.1, may_move=True) is None, "the robot has started"


def test_each_shown_fault_stays_for_at_least_three_seconds():
    """Faults that count seconds, alternate between two causes, or recur once a second."""
    chance, steady, shown, changed_s = random.Random(5), SteadyFault(), None, -STEADY_S
    for tick in range(4000):
        now_s = tick * 0.05
        fault = chance.choice((None, "repeats", "nothing", f"silent for {now_s:.1f} s"))
        now = steady.show(fault, now_s, may_move=False)
        if now != shown:
            assert now_s - changed_s >= STEADY_S - 1e-9
            shown, changed_s = now, now_s
