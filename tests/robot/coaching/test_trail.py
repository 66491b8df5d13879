"""Which points the trail keeps, and how a client gets the points that it lacks."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from robot.coaching.trail import POINTS, STEP_M, STEP_RAD, Event, Trail
from robot.control.state import Tick
from robot.driver import Pose, Sensors
from robot.policy.events import Replaced
from robot.types import Action, Decision, DrivenBy, Mode, Prediction
from tests.kit.sizes import seeds

HERE = Pose(x_m=1.0, y_m=1.0, heading_rad=0.0)


def tick_at(pose, by=DrivenBy.ROBOT, *, mode=Mode.AUTONOMOUS, asks=False, bumped=False,
            stalled=False, events=()):  # fmt: skip
    action = Action.STOP if mode is Mode.STOPPED else Action.FORWARD
    return Tick(
        now_s=0.0,
        decision=Decision(action=action, driven_by=by, mode=mode, asks_pilot=asks),
        sent=action,
        prediction=Prediction(
            frame_id=1, action=action, confidence=1.0, probabilities={}, is_stalled=stalled
        ),
        sensors=Sensors(pose=pose, bumped=bumped),
        history_events=events,
    )


@pytest.mark.parametrize("seed", seeds(8, 30))
def test_a_client_that_requests_it_now_and_then_gets_the_whole_trail(seed):
    """A client that joins the answers to one trail, like the page."""
    chance, trail = random.Random(seed), Trail()
    first, points = 0, []
    x_m = heading_rad = since_replaced = 0
    length = chance.choice([50, 500, 6000])
    for step in range(length):
        x_m += chance.uniform(0.0, 0.05)
        heading_rad += chance.uniform(-0.1, 0.1)
        events = (Replaced(policy_name="default-32"),) if chance.random() < 0.002 else ()
        by = chance.choice(list(DrivenBy)) if chance.random() < 0.1 else DrivenBy.ROBOT
        trail.note(tick_at(Pose(x_m=x_m, y_m=0.0, heading_rad=heading_rad), by, events=events))
        since_replaced = 0 if events else since_replaced + 1
        if chance.random() < 0.05 or step == length - 1:
            known = first + len(points)
            begins, more = trail.since(known)
            first, points = (first, points + more) if begins == known else (begins, more)
    _, whole = trail.since(-1)
    assert points[-POINTS:] == whole
    assert len(whole) <= min(POINTS, since_replaced + 1)
    for a, b in itertools.pairwise(whole):
        gone_m = math.hypot(b.pose.x_m - a.pose.x_m, b.pose.y_m - a.pose.y_m)
        turned_rad = abs(math.remainder(b.pose.heading_rad - a.pose.heading_rad, math.tau))
        is_elsewhere = gone_m >= STEP_M or turned_rad >= STEP_RAD
        assert is_elsewhere or a.driven_by != b.driven_by or b.events, (
            "no point repeats the previous point"
        )


@pytest.mark.parametrize(("pose", "points"), [(HERE, 1), (None, 0)])
def test_standing_still_costs_nothing_and_an_unknown_place_leaves_no_trail(pose, points):
    trail = Trail()
    for _ in range(100):
        trail.note(tick_at(pose, DrivenBy.NOBODY))
    assert len(trail.since(0)[1]) == points


def test_each_event_is_marked_once_where_it_begins():
    trail = Trail()
    for state in 5 * [
        {}, {"asks": True}, {"bumped": True}, {"stalled": True}, {"by": DrivenBy.PILOT}
    ]:  # fmt: skip
        for _ in range(3):
            trail.note(tick_at(HERE, **state))
    events = [event for point in trail.since(0)[1] for event in point.events]
    assert events == [Event.ASKED, Event.PUSHED, Event.CORRECTED] * 5


def test_teaching_does_not_count_as_correcting_nor_standing_at_a_wall_as_pushing():
    trail = Trail()
    trail.note(tick_at(HERE, DrivenBy.PILOT, mode=Mode.TRAIN))
    trail.note(tick_at(HERE, DrivenBy.NOBODY, mode=Mode.STOPPED, bumped=True))
    assert [point.events for point in trail.since(0)[1]] == [(), ()]
