from __future__ import annotations

from robot.policy.commitment import STRAIGHT_INERTIA, TURN_INERTIA, Commitment
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT


def test_left_and_right_never_follow_each_other():
    commitment = Commitment()
    assert commitment.choose({F: 0.1, L: 0.5, R: 0.4}) is L
    assert commitment.choose({F: 0.1, L: 0.2, R: 0.7}) is L
    assert commitment.choose({F: 0.5, L: 0.1, R: 0.4}) is F
    assert commitment.choose({F: 0.1, L: 0.2, R: 0.7}) is L, "one frame straight pays nothing back"
    commitment.free()
    assert commitment.choose({F: 0.1, L: 0.2, R: 0.7}) is R


def test_a_move_under_way_goes_on_until_another_is_clearly_better():
    commitment = Commitment()
    little, much = 0.5 + 0.4 * TURN_INERTIA, 0.5 + 0.6 * TURN_INERTIA
    assert commitment.choose({F: little, L: 1 - little}, L) is L
    assert commitment.choose({F: little, L: 1 - little}) is F
    assert commitment.choose({F: much, L: 1 - much}, L) is F


def test_driving_straight_yields_sooner_than_a_turn():
    commitment = Commitment()
    between = 0.5 + 0.25 * (STRAIGHT_INERTIA + TURN_INERTIA)
    assert commitment.choose({F: between, L: 1 - between}, L) is L
    assert commitment.choose({F: 1 - between, L: between}, F) is L


def test_standing_still_is_no_move_under_way():
    assert Commitment().choose({F: 0.4, L: 0.6}, Action.STOP) is L
