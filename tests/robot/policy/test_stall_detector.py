from __future__ import annotations

import numpy as np
import pytest

from robot.policy.action_filter import StallDetector
from robot.policy.move_kinds import MoveKinds
from robot.policy.part import Seen
from robot.policy.pilot_pace import AWAY_S, STUCK_S, PilotPace
from robot.types import Action

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
BRAKE, GRIP = Action("brake"), Action("grip")


class Drive:
    """Pictures at 20 Hz: of a moving stripe, or of a still stripe with noise."""

    def __init__(self):
        kinds = MoveKinds((F, L, R, BRAKE, GRIP))
        self.standstill, self.pace = StallDetector(kinds), PilotPace(kinds)
        self.pace.stands.append(GRIP)
        self.now_s, self.shift = 100.0, 0
        self.rng = np.random.default_rng(3)

    @property
    def barred(self):
        return set(self.standstill.futile)

    def go(self, seconds, under_way, is_moving, bumped=False, gives_up=F):
        """Go on driving; return when the move was first barred, in seconds after the start."""
        first_s = None
        for i in range(round(seconds * 20)):
            self.shift += is_moving
            self.now_s += 0.05
            picture = np.full((30, 40), 60, np.uint8)
            picture[:, self.shift % 30 : self.shift % 30 + 10] = 180
            picture += self.rng.integers(0, 4, (30, 40), np.uint8)
            self.look(picture, under_way, bumped)
            barred = self.standstill.futile
            if barred and first_s is None:
                assert barred[-1] is gives_up
                first_s = (i + 1) * 0.05
        return first_s

    def look(self, picture, under_way, bumped=False):
        seen = Seen(number=1, x=picture, picture=picture, at_s=self.now_s)
        seen.under_way, seen.bumped = under_way, bumped
        self.standstill.look(seen, self.pace)


@pytest.fixture
def drive():
    return Drive()


@pytest.mark.parametrize("bumped", [False, True])
def test_pushing_is_noticed_in_half_a_second(drive, bumped):
    """A pressed bumper tells it although the picture slides."""
    assert drive.go(3, F, is_moving=True) is None
    noticed_s = drive.go(3, F, is_moving=bumped, bumped=bumped)
    assert STUCK_S - 0.1 <= noticed_s <= STUCK_S + 0.2
    assert drive.barred == {F}


@pytest.mark.parametrize(
    ("longest_turn_s", "away_s"), [(0.0, AWAY_S), (0.3, STUCK_S), (1.5, 0.9), (8.0, AWAY_S)]
)
def test_the_move_is_free_again_once_the_robot_has_turned_away(drive, longest_turn_s, away_s):
    drive.pace.longest_lost_s = longest_turn_s
    drive.go(3, F, is_moving=True)
    while not drive.barred:
        drive.go(0.05, F, is_moving=False)
    given_up_s = drive.now_s
    while drive.barred:
        drive.go(0.05, L, is_moving=True)
    assert drive.now_s - given_up_s == pytest.approx(away_s, abs=0.15)


def test_the_move_is_free_again_after_a_turn_that_changes_the_picture_slowly(drive):
    drive.go(3, F, is_moving=True)
    assert drive.go(STUCK_S + 0.2, F, is_moving=False) is not None
    for grey in range(60, 100):
        drive.now_s += 0.1
        drive.look(np.full((30, 40), grey, np.uint8), L)
    assert not drive.barred


@pytest.mark.parametrize("under_way", [L, Action.STOP, None])
def test_turning_and_standing_on_purpose_do_not_count_as_pushing(drive, under_way):
    drive.go(3, F, is_moving=True)
    assert drive.go(5, under_way, is_moving=False) is None


def test_a_move_given_up_is_not_taken_up_before_the_picture_moves(drive):
    drive.go(3, F, is_moving=True)
    drive.go(STUCK_S + 0.2, F, is_moving=False)
    assert drive.go(2 * AWAY_S, L, is_moving=False) is not None
    assert drive.barred == {F}
    drive.go(0.2, L, is_moving=True)
    assert drive.go(2, F, is_moving=True) is None


def test_a_move_that_does_not_help_is_given_up_too_until_all_are_tried_again(drive):
    drive.go(3, F, is_moving=True)
    for move in (BRAKE, F):
        before = drive.barred
        drive.go(STUCK_S - 0.2, move, is_moving=False, gives_up=BRAKE)
        assert drive.barred == before
        drive.go(0.4, move, is_moving=False, gives_up=BRAKE)
        assert drive.barred == before | {move}
    drive.standstill.lift()
    assert drive.go(0.1, F, is_moving=False) is None


def test_a_move_that_nobody_knows_is_given_up_unless_the_pilot_stood_with_it(drive):
    drive.go(3, F, is_moving=True)
    assert drive.go(5, GRIP, is_moving=False) is None
    assert drive.go(5, BRAKE, is_moving=True, bumped=True) is None
    assert drive.go(5, BRAKE, is_moving=False, gives_up=BRAKE) is not None


def test_a_flash_of_light_does_not_make_all_after_it_look_still(drive):
    drive.go(3, F, is_moving=True)
    flash = np.full((30, 40), 255, np.uint8)
    drive.now_s += 0.1
    drive.look(flash, F)
    assert drive.go(3, F, is_moving=True) is None
