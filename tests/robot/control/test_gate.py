"""The gate decides who drives, and stops the robot for each of its reasons."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace

import pytest

from robot.control.config import GateConfig
from robot.control.gate import Gate
from robot.types import Action, Decision, DrivenBy, Mode, PilotCommand, Prediction, StopReason

LEFT_PREDICTED = Prediction(
    frame_id=1, action=Action.LEFT, confidence=0.9, probabilities={Action.LEFT: 1.0}
)
NOVEL = Prediction(
    frame_id=1, action=Action.LEFT, confidence=0.4, probabilities={Action.LEFT: 1.0}, novelty=1.5
)
MOVING = pytest.mark.parametrize("mode", [Mode.TRAIN, Mode.AUTONOMOUS])
TIMEOUT_S = GateConfig().frame_timeout_s
NOTHING_LEARNED = Prediction(frame_id=1, action=None, confidence=0.0, probabilities={})


def hold(gate: Gate, action: Action | None, now_s: float) -> None:
    gate.receive(PilotCommand(held=action, frame_id=1, seq=1, received_s=now_s), now_s)


def select(
    gate: Gate,
    now_s: float,
    prediction: Prediction | None = LEFT_PREDICTED,
    frame_age_s: float = 0.03,
    *,
    camera_fault: bool = False,
) -> Decision:
    return gate.select(now_s, prediction, frame_age_s, TIMEOUT_S, camera_fault=camera_fault)


def started(mode: Mode, now_s: float = 0.0) -> Gate:
    gate = Gate(GateConfig())
    assert gate.start(mode, now_s)
    return gate


def who_drives(decision: Decision) -> tuple[Action, DrivenBy, bool]:
    return decision.action, decision.driven_by, decision.asks_pilot


STANDS = (Action.STOP, DrivenBy.NOBODY, False)


def test_a_new_gate_stands_whatever_is_held_or_predicted():
    gate = Gate()
    hold(gate, Action.FORWARD, 0.0)
    decision = select(gate, 0.0)
    assert (who_drives(decision), decision.mode) == (STANDS, Mode.STOPPED)


@pytest.mark.parametrize(
    ("mode", "alone"),
    [(Mode.TRAIN, STANDS), (Mode.AUTONOMOUS, (Action.LEFT, DrivenBy.ROBOT, False))],
)
def test_the_pilots_move_has_priority_while_it_is_held(mode, alone):
    gate = started(mode)
    assert who_drives(select(gate, 0.1)) == alone
    hold(gate, Action.RIGHT, 0.2)
    assert who_drives(select(gate, 0.2)) == (Action.RIGHT, DrivenBy.PILOT, False)
    hold(gate, None, 0.3)
    assert who_drives(select(gate, 0.3)) == alone


@pytest.mark.parametrize(
    ("mode", "held", "limit_s"),
    [
        (Mode.TRAIN, Action.FORWARD, 0.3),
        (Mode.TRAIN, None, 0.3),
        (Mode.AUTONOMOUS, None, 0.45),
        (Mode.AUTONOMOUS, Action.FORWARD, 0.3),
    ],
)
def test_a_pilot_who_is_silent_for_longer_than_the_limit_stops_the_robot(mode, held, limit_s):
    gate = started(mode, now_s=-0.2)
    hold(gate, held, 0.0)
    assert select(gate, limit_s).mode is mode
    decision = select(gate, limit_s + 0.01)
    assert (decision.mode, decision.action) == (Mode.STOPPED, Action.STOP)
    assert decision.stop_reason is StopReason.PILOT_SILENT


def test_a_start_counts_as_a_command_and_expires_like_one():
    gate = started(Mode.AUTONOMOUS, now_s=5.0)
    assert select(gate, 5.4).driven_by is DrivenBy.ROBOT
    assert select(gate, 5.5).stop_reason is StopReason.PILOT_SILENT


@MOVING
def test_a_stale_picture_stops_the_robot(mode):
    gate = started(mode)
    hold(gate, Action.FORWARD, 0.2)
    assert select(gate, 0.2, frame_age_s=0.2).action is Action.FORWARD, "0.2 s is still fresh"
    assert select(gate, 0.2, frame_age_s=0.21).stop_reason is StopReason.FRAME_STALE


@pytest.mark.parametrize(("transit_s", "is_taken"), [(0.25, True), (0.3, True), (0.31, False)])
@MOVING
def test_a_command_that_was_in_transit_for_too_long_is_not_obeyed(mode, transit_s, is_taken):
    gate = started(mode)
    command = PilotCommand(held=Action.RIGHT, frame_id=1, seq=1, received_s=transit_s, proven_s=0.0)
    assert gate.receive(command, transit_s) is is_taken
    assert gate.held is (Action.RIGHT if is_taken else None)


def test_a_command_without_a_picture_is_not_obeyed_however_fresh():
    gate = started(Mode.TRAIN)
    blind = PilotCommand(held=Action.RIGHT, frame_id=None, seq=1, received_s=0.1)
    assert gate.receive(blind, 0.1) is False
    assert select(gate, 0.1).action is Action.STOP
    assert select(gate, 0.31).stop_reason is StopReason.LINK_SLOW, "a refusal counts as silence"


@pytest.mark.parametrize(("transit_s", "is_taken"), [(0.25, True), (0.3, True), (0.31, False)])
@pytest.mark.parametrize("before", [Mode.STOPPED, Mode.TRAIN, Mode.AUTONOMOUS])
def test_a_start_that_was_in_transit_for_too_long_stops_the_robot(before, transit_s, is_taken):
    gate = Gate()
    gate.start(before, 0.0)
    hold(gate, Action.FORWARD, transit_s)
    assert gate.start(Mode.TRAIN, transit_s, proven_s=0.0) is is_taken
    assert gate.mode is (Mode.TRAIN if is_taken else Mode.STOPPED)
    assert gate.held is None
    assert gate.stop_reason is (None if is_taken else StopReason.LINK_SLOW)


@MOVING
@pytest.mark.parametrize("frame_age_s", [math.inf, 0.21, 3.0])
def test_a_start_waits_at_most_half_a_second_for_a_fresh_picture(mode, frame_age_s):
    gate = started(mode)
    for now_s in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5):
        hold(gate, Action.FORWARD, now_s)
        decision = select(gate, now_s, frame_age_s=frame_age_s)
        assert (who_drives(decision), decision.mode, decision.stop_reason) == (STANDS, mode, None)
    late = copy(gate)
    assert select(gate, 0.5).action is Action.FORWARD
    assert select(gate, 0.5, frame_age_s=0.21).stop_reason is StopReason.FRAME_STALE
    assert select(late, 0.51, frame_age_s=math.inf).stop_reason is StopReason.FRAME_STALE
    silent = started(Mode.TRAIN)
    assert select(silent, 0.31, None, math.inf).stop_reason is StopReason.PILOT_SILENT


@pytest.mark.parametrize("frame_age_s", [0.03, math.inf])
def test_a_faulty_camera_stops_the_robot(frame_age_s):
    gate = started(Mode.AUTONOMOUS)
    decision = select(gate, 0.1, frame_age_s=frame_age_s, camera_fault=True)
    assert decision.stop_reason is StopReason.CAMERA_FAULT


def test_after_a_stop_only_an_explicit_start_moves_the_robot():
    gate = started(Mode.AUTONOMOUS)
    gate.trip(StopReason.PILOT_GONE)
    hold(gate, Action.FORWARD, 0.1)
    decision = select(gate, 0.1)
    assert (decision.action, decision.stop_reason) == (Action.STOP, StopReason.PILOT_GONE)
    assert gate.start(Mode.AUTONOMOUS, 0.2)
    assert gate.held is None
    assert select(gate, 0.2).driven_by is DrivenBy.ROBOT


@MOVING
def test_a_pilot_who_asks_for_a_stop_gets_it(mode):
    gate = started(mode)
    hold(gate, Action.FORWARD, 0.1)
    assert gate.start(Mode.STOPPED, 0.1) is True
    decision = select(gate, 0.1)
    assert (decision.action, decision.mode) == (Action.STOP, Mode.STOPPED)
    assert decision.stop_reason is StopReason.PILOT_ASKED
    assert gate.held is None


@MOVING
def test_an_emergency_latches_until_it_is_released(mode):
    gate = started(mode)
    hold(gate, Action.FORWARD, 0.1)
    gate.latch_emergency()
    assert not gate.start(Mode.TRAIN, 0.1)
    decision = select(gate, 0.1)
    assert (decision.action, decision.mode) == (Action.STOP, Mode.STOPPED)
    assert decision.stop_reason is StopReason.EMERGENCY
    gate.release_emergency()
    assert select(gate, 0.1).action is Action.STOP
    assert gate.start(Mode.TRAIN, 0.2)


def test_the_first_reason_of_a_stop_is_kept_and_counted_once():
    told: list[Mode] = []
    gate = Gate(on_stop=lambda: told.append(gate.mode))
    gate.trip(StopReason.PILOT_GONE)
    assert gate.stop_reason is None, "the robot had never started"
    assert gate.start(Mode.TRAIN, 0.0) and gate.silent_at_s < math.inf
    gate.trip(StopReason.CAMERA_FAULT)
    gate.trip(StopReason.PILOT_GONE)
    assert gate.stop_reason is StopReason.CAMERA_FAULT
    assert gate.stops == {StopReason.CAMERA_FAULT: 1}
    assert told == [Mode.STOPPED]
    assert gate.silent_at_s == math.inf, "a stopped robot needs no commands"


@pytest.mark.parametrize(
    ("view", "action", "scale"),
    [
        (NOTHING_LEARNED, Action.STOP, 1.0),
        (replace(NOVEL, action=Action.FORWARD), Action.FORWARD, 0.5),
        (replace(NOVEL, is_turn=True), Action.LEFT, 1.0),
        (replace(NOVEL, needs_help=True), Action.STOP, 1.0),
    ],
    ids=["nothing learned", "straight on at a novel view", "turning away from it", "stuck"],
)
def test_a_robot_that_does_not_know_the_view_asks_and_drives_straight_slowly(view, action, scale):
    gate = started(Mode.AUTONOMOUS)
    decision = select(gate, 0.1, view)
    assert who_drives(decision) == (action, DrivenBy.ROBOT, True)
    assert (decision.speed_scale, decision.mode) == (scale, Mode.AUTONOMOUS)
    assert decision.stop_reason is (StopReason.NEEDS_HELP if view.needs_help else None)
    assert gate.stop_reason is None, "a request for help is not a stop"
