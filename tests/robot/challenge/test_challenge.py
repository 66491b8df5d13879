"""In the challenge, tricks score less than a robot that drives an average course."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle
from typing import Any

import pytest

from robot.challenge.score import Score
from robot.challenge.tries import TRIES, TRY_S, Challenge, Ending
from robot.control.state import Tick
from robot.driver import Pose, Sensors
from robot.policy.events import Replaced
from robot.types import Action, Decision, DrivenBy, Mode

SPEED_M_S, TURN_RAD_S, STEP_S = 0.2, 1.6, 0.05
QUARTER_S = math.pi / 2 / TURN_RAD_S
START = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)
Part = tuple[float, float, float]
"""Parts of a drive: seconds, and the speed and turn rate as shares of the robot's maximum."""
DICE = random.Random(4)


def polygon(corners: int, side_m: float) -> list[Part]:
    return [(side_m / SPEED_M_S, 1.0, 0.0), (math.tau / corners / TURN_RAD_S, 0.0, 1.0)]


def lane(turn: float) -> list[Part]:
    quarter = (QUARTER_S, 0.0, turn)
    return [(2.0, 1.0, 0.0), quarter, (0.5, 1.0, 0.0), quarter]


CHEATS: dict[str, list[Part]] = {
    "stand still": [(1.0, 0.0, 0.0)],
    "spin": [(1.0, 0.0, 1.0)],
    "circle": [(1.0, 1.0, 1.0)],
    "figure of eight": [(4 * QUARTER_S, 1.0, 1.0), (4 * QUARTER_S, 1.0, -1.0)],
    "back and forth backwards": [(4.0, 1.0, 0.0), (4.0, -1.0, 0.0)],
    "back and forth with a turn": [(4.0, 1.0, 0.0), (2 * QUARTER_S, 0.0, 1.0)],
    "spiral": [(STEP_S, 1.0, max(0.5, 0.999**step)) for step in range(1200)],
    "shake": [(0.1, DICE.choice([-1.0, 1.0]), DICE.uniform(-1, 1)) for _ in range(600)],
    "wiggle on the spot": [(0.5, 0.0, 1.0), (0.5, 0.0, -1.0)],
    "round a table": [(1.0, 1.0, SPEED_M_S / 0.5 / TURN_RAD_S)],
    "circles that drift": [(math.tau * 0.36 / SPEED_M_S, 1.0, 0.35), (1.0, 1.0, 0.0)],
    "small square": polygon(4, 0.35),
    "small polygon": polygon(12, 0.2),
    "back in two curves": [(1.6, 1.0, 0.0), (1.9, -1.0, 0.8), (1.9, -1.0, -0.8)],
}
FEWER: dict[str, list[Part]] = {
    "drifting square": [(1.5, 1.0, 0.0), (1.03 * QUARTER_S, 0.0, 1.0)],
    "star": [(1.6, 1.0, 0.0), (math.radians(135) / TURN_RAD_S, 0.0, 1.0)],
    "back in a wide curve": [(7.5, 1.0, 0.0), (7.5, -1.0, 0.3)],
    "narrow lanes": [*lane(1.0), *lane(-1.0)],
}
"""Drives that slightly resemble a course; they may score, but much less than a course."""
HONEST_BOX = [(3.5, 1.0, 0.0), (QUARTER_S, 0.2, 1.0)]
"""Rounds of an average robot in the smallest box, which is 1.15 m wide."""


def tick(at_s: float, pose: Pose | None, by: DrivenBy = DrivenBy.ROBOT, **more: Any) -> Tick:
    decision = Decision(
        mode=more.pop("mode", Mode.AUTONOMOUS),
        driven_by=by,
        action=Action.FORWARD,
        asks_pilot=more.pop("asks", False),
    )
    sensors = Sensors(pose=pose, bumped=more.pop("bumped", None))
    return Tick(now_s=at_s, decision=decision, sent=Action.FORWARD, sensors=sensors)


def poses(way: list[Part], until_s: float = TRY_S) -> Iterator[tuple[float, Pose]]:
    """Yield times and poses of a robot that repeats these parts."""
    x_m = y_m = heading = at_s = 0.0
    for seconds, speed, turn in cycle(way):
        for _ in range(round(seconds / STEP_S)):
            if at_s > until_s:
                return
            yield at_s, Pose(x_m=x_m, y_m=y_m, heading_rad=heading)
            heading += turn * TURN_RAD_S * STEP_S
            x_m += speed * SPEED_M_S * STEP_S * math.cos(heading)
            y_m += speed * SPEED_M_S * STEP_S * math.sin(heading)
            at_s += STEP_S


def score(way: list[Part]) -> float:
    counted = Score()
    for _, pose in poses(way):
        counted.note(pose)
    return counted.metres


@pytest.mark.parametrize("way", [*CHEATS, *FEWER])
def test_no_trick_scores_as_much_as_an_honest_average_robot(way):
    honest_m = score(HONEST_BOX)
    assert honest_m > 4.0
    if way in CHEATS:
        assert score(CHEATS[way]) == 0.0
    else:
        assert score(FEWER[way]) < 0.6 * honest_m


def test_a_larger_course_is_worth_more_than_rounds_of_a_small_one():
    assert score([(8.0, 1.0, 0.0), (QUARTER_S, 0.2, 1.0)]) > 1.2 * score(HONEST_BOX)
    assert score([(1.0, 1.0, 0.0)]) == pytest.approx(TRY_S * SPEED_M_S, abs=0.4)


def test_a_robot_scores_nothing_while_it_is_carried():
    counted = Score()
    for x_m in (0.0, 3.0, 6.0, math.inf, math.nan):
        counted.note(Pose(x_m=x_m, y_m=0.0, heading_rad=0.0))
    assert counted.metres == 0.0


def straight_on(challenge: Challenge, seconds: float, start_s: float = 0.0) -> None:
    for at_s, pose in poses([(seconds, 1.0, 0.0)], seconds):
        assert challenge.note(tick(start_s + at_s, pose)) is None


@pytest.fixture
def challenge():
    """A challenge whose first try is armed."""
    challenge = Challenge()
    challenge.arm()
    return challenge


@pytest.mark.parametrize(
    ("last", "ending"),
    [
        ({"by": DrivenBy.PILOT}, Ending.TOUCHED),
        ({"asks": True}, Ending.ASKED),
        ({"mode": Mode.STOPPED, "by": DrivenBy.NOBODY}, Ending.STOPPED),
        ({"bumped": True}, Ending.BUMPED),
        ({}, Ending.TIME),
    ],
)
def test_a_failure_or_its_time_ends_the_try_and_the_metres_until_then_count(
    challenge, last, ending
):
    length_s = 10.0 if last else TRY_S
    driven = list(poses([(length_s, 1.0, 0.0)], length_s))
    ended = [challenge.note(tick(at_s, pose)) for at_s, pose in driven]
    at_s, pose = driven[-1]
    ended += [challenge.note(tick(at_s + 0.1 * i, pose, **dict(last))) for i in range(1, 6)]
    [done] = [one for one in ended if one is not None]
    assert done.ended_by is ending
    assert done.seconds == pytest.approx(length_s, abs=0.5)
    assert done.metres == pytest.approx(length_s * SPEED_M_S - 0.2, abs=0.2)
    assert challenge.best_m == done.metres


def test_a_try_that_is_stopped_before_it_scores_is_not_used_up(challenge):
    assert challenge.note(tick(0.0, START)) is None and challenge.is_on
    stopped = tick(0.1, START, DrivenBy.NOBODY, mode=Mode.STOPPED)
    assert challenge.note(stopped) is None
    assert challenge.tries == () and challenge.is_armed and not challenge.is_on


def test_of_three_tries_the_best_counts():
    challenge, start_s = Challenge(), 0.0
    for seconds in (5.0, 20.0, 10.0):
        assert not challenge.is_on
        challenge.arm()
        straight_on(challenge, seconds, start_s)
        challenge.note(tick(start_s + seconds, None, DrivenBy.PILOT))
        start_s += 100.0
    assert len(challenge.tries) == TRIES
    assert challenge.best_m == max(one.metres for one in challenge.tries)
    challenge.note(tick(start_s, START))
    assert not challenge.is_on, "a drive that nobody armed does not count as a try"
    challenge.arm()
    assert challenge.tries == () and challenge.best_m is not None


@pytest.mark.parametrize("is_on", [False, True])
def test_another_model_ends_the_challenge(challenge, is_on):
    straight_on(challenge, 10.0)
    challenge.note(tick(11.0, None, DrivenBy.PILOT))
    challenge.is_shown = True
    challenge.arm()
    if is_on:
        challenge.note(tick(12.0, START))
    assert challenge.tries and challenge.is_on is is_on
    stopped = tick(13.0, None, DrivenBy.NOBODY, mode=Mode.STOPPED)
    challenge.note(replace(stopped, history_events=(Replaced(policy_name="x"),)))
    assert (challenge.tries, challenge.best_m, challenge.is_shown) == ((), None, False)
    assert not challenge.is_on and not challenge.is_armed
