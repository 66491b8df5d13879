from __future__ import annotations

import numpy as np
import pytest

from robot.moves import Move
from robot.policy.move_kinds import MoveKinds
from robot.policy.pilot_pace import LONGEST_LOST_S, SHORTEST_LOST_S, STUCK_S, PilotPace
from robot.types import Action, Point
from tests.kit.sizes import crossed
from tests.robot.policy.passing import teach

F, L, R = Action.FORWARD, Action.LEFT, Action.RIGHT
KINDS = MoveKinds((F, L, R))
BRAKE, GRIP = Action("brake"), Action("grip")


class Pilot:
    """Labelled frames at some rate, with pictures of a stripe that moves or stands."""

    def __init__(self, rate_hz=10.0, kinds=KINDS):
        self.pace, self.dt_s = PilotPace(kinds), 1 / rate_hz
        self.now_s, self.shift = 0.0, 0.0
        self.rng = np.random.default_rng(3)

    def drive(self, label, seconds, is_moving=True, point=None):
        for _ in range(round(seconds / self.dt_s)):
            self.now_s += self.dt_s
            self.shift += is_moving * 20 * self.dt_s
            at = int(self.shift) % 30
            picture = np.full((30, 40), 60, np.uint8)
            picture[:, at : at + 10] = 180
            picture += self.rng.integers(0, 4, (30, 40), np.uint8)
            teach(self.pace, label, self.now_s, picture=picture.ravel(), point=point)
        return self


@pytest.mark.parametrize("rate_hz", [5, 10, 15, 30])
def test_the_longest_manoeuvre_sets_the_measure_at_any_frame_rate(rate_hz):
    pilot = Pilot(rate_hz).drive(F, 3).drive(L, 5).drive(F, 3).drive(R, 2).drive(F, 2)
    assert pilot.pace.longest_lost_s == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("drives", "lost_s"),
    [
        ([(F, 2), (L, 2), (F, 0.6), (R, 2)], 2 - 4 * 0.4 + 2),
        ([(L, 2), (L, 4, True, Point(-0.3, 0.5)), (R, 2)], 2.0),
    ],
    ids=["back and forth", "a wide curve between"],
)
def test_turns_are_one_manoeuvre_until_driving_straight_makes_up_for_them(drives, lost_s):
    pilot = Pilot()
    for part in drives:
        pilot.drive(*part)
    assert pilot.pace.longest_lost_s == pytest.approx(lost_s, abs=0.5)


@pytest.mark.parametrize(("steering", "lost_s"), [(1.0, 5.0), (0.8, 3.0), (0.6, 1.0), (0.3, 0.0)])
def test_a_proportional_curve_counts_only_partly_as_lost_time(steering, lost_s):
    pilot = Pilot().drive(F, 3).drive(L, 5, point=Point(-steering, 0.5)).drive(F, 2)
    assert pilot.pace.longest_lost_s == pytest.approx(lost_s, abs=0.3)


def test_the_pilots_measure_has_bounds():
    assert PilotPace(KINDS).lost_limit_s == SHORTEST_LOST_S
    assert Pilot().drive(L, 60).pace.longest_lost_s == LONGEST_LOST_S


def test_one_push_counts_as_a_slip_and_three_as_intended():
    pilot = Pilot().drive(F, 4)
    for n_pushes in range(1, 4):
        pilot.drive(F, 2.0, is_moving=False).drive(L, 1).drive(F, 2)
        if n_pushes < 3:
            assert pilot.pace.patience_s == STUCK_S
    assert pilot.pace.patience_s == pytest.approx(3.0, abs=0.5)


def test_corrections_with_pauses_between_them_are_separate_manoeuvres():
    pilot = Pilot()
    for _ in range(10):
        pilot.drive(L, 2.0)
        pilot.now_s += 0.5  # the maximum teaching time of a pause
    assert pilot.pace.longest_lost_s == pytest.approx(2.0, abs=0.3)


@crossed(moves=[(F, L, BRAKE, GRIP), (BRAKE, GRIP)], rate_hz=[5, 10, 30])
def test_standing_with_an_unknown_move_counts_as_intended(moves, rate_hz):
    kinds = MoveKinds(moves)
    pilot = Pilot(rate_hz, kinds).drive(moves[0], 3).drive(GRIP, 0.3, is_moving=False)
    pilot.drive(BRAKE, 3).drive(GRIP, 1.5, is_moving=False).drive(BRAKE, 0.3, is_moving=False)
    assert pilot.pace.stands == [GRIP]
    other = PilotPace(kinds)
    other.load(*pilot.pace.save(), names={str(move): move for move in moves})
    assert other.stands == [GRIP]


@crossed(stood_s=[1.5, 1.54, 1.57], rate_hz=[5, 10, 30])
def test_standing_is_counted_separately_for_each_move(rate_hz, stood_s):
    pilot = Pilot(rate_hz, MoveKinds((F, L, BRAKE))).drive(F, 3).drive(F, stood_s, is_moving=False)
    assert pilot.drive(BRAKE, 0.2, is_moving=False).pace.stands == []


@crossed(rate_hz=[10, 15, 30], run_s=[0.4, 1.0, 3.0])
def test_how_long_the_pilot_keeps_to_a_move_is_known_at_any_frame_rate(rate_hz, run_s):
    pilot = Pilot(rate_hz)
    pilot.drive(F, run_s)
    assert pilot.pace.usual_run_s is None
    for _ in range(8):
        pilot.drive(L, run_s).drive(F, run_s)
    assert pilot.pace.usual_run_s == pytest.approx(run_s, abs=0.1)


def test_whether_a_move_is_straight_depends_on_its_effect_and_not_on_its_name():
    """A still picture counts as pushing for one body, but not for the other."""
    push, name = [], Action("go")
    for steering in (0.0, 0.8):
        pilot = Pilot()
        pilot.pace = PilotPace(MoveKinds((name,)))
        pilot.pace.kinds.describe([Move(name, steering=steering, throttle=0.5)])
        pilot.drive(name, 4)
        for _ in range(3):
            pilot.drive(name, 2.0, is_moving=False).drive(name, 2)
        push.append(pilot.pace.patience_s > STUCK_S)
    assert push == [True, False]
