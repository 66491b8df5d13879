"""The trail: which points are kept, and how a client gets the points that it lacks."""

from __future__ import annotations

import itertools
import math
import random
from typing import Any

import pytest

from robot.coaching.trail import POINTS, STEP_M, STEP_RAD, Event, Trail, Waypoint
from robot.control.state import Tick
from robot.driver import Pose, Sensors
from robot.policy.events import Replaced
from robot.types import Action, Decision, DrivenBy, Mode, Prediction
from tests.kit.sizes import seeds


def tick_at(
    pose: Pose | None,
    by: DrivenBy = DrivenBy.ROBOT,
    *,
    mode: Mode = Mode.AUTONOMOUS,
    sent: Action = Action.FORWARD,
    asks: bool = False,
    bumped: bool = False,
    stalled: bool = False,
    replaced: bool = False,
) -> Tick:
    return Tick(
        now_s=0.0,
        decision=Decision(action=sent, driven_by=by, mode=mode, asks_pilot=asks),
        sent=sent,
        prediction=Prediction(
            frame_id=1, action=sent, confidence=1.0, probabilities={}, is_stalled=stalled
        ),
        sensors=Sensors(pose=pose, bumped=bumped),
        history_events=(Replaced(policy_name="default-32"),) if replaced else (),
    )


class _Client:
    """Requests the trail from time to time and assembles the answers, like the page."""

    def __init__(self) -> None:
        self.first, self.points = 0, list[Waypoint]()

    def ask(self, trail: Trail) -> None:
        known = self.first + len(self.points)
        first, points = trail.since(known)
        if first == known:
            self.points += points
        else:
            self.first, self.points = first, points


@pytest.mark.parametrize("seed", seeds(8, 30))
def test_a_client_that_asks_now_and_then_knows_the_whole_way(seed: int) -> None:
    chance = random.Random(seed)
    trail, client = Trail(), _Client()
    x_m = heading_rad = 0.0
    since_replaced = 0
    for _ in range(chance.choice([50, 500, 6000])):
        x_m += chance.uniform(0.0, 0.05)
        heading_rad += chance.uniform(-0.1, 0.1)
        is_new = chance.random() < 0.002
        by = chance.choice(list(DrivenBy)) if chance.random() < 0.1 else DrivenBy.ROBOT
        trail.note(tick_at(Pose(x_m=x_m, y_m=0.0, heading_rad=heading_rad), by, replaced=is_new))
        since_replaced = 0 if is_new else since_replaced + 1
        if chance.random() < 0.05:
            client.ask(trail)
    client.ask(trail)
    _, whole = trail.since(-1)
    assert client.points[-POINTS:] == whole
    assert len(whole) <= min(POINTS, since_replaced + 1)
    for a, b in itertools.pairwise(whole):
        gone_m = math.hypot(b.pose.x_m - a.pose.x_m, b.pose.y_m - a.pose.y_m)
        turned_rad = abs(math.remainder(b.pose.heading_rad - a.pose.heading_rad, math.tau))
        assert (
            gone_m >= STEP_M or turned_rad >= STEP_RAD or a.driven_by != b.driven_by or b.events
        ), "no point says what another said before"


@pytest.mark.parametrize(
    ("pose", "points"), [(Pose(x_m=1.0, y_m=1.0, heading_rad=0.0), 1), (None, 0)]
)
def test_standing_still_costs_nothing_and_an_unknown_place_leaves_no_trail(
    pose: Pose | None, points: int
) -> None:
    trail = Trail()
    for _ in range(100):
        trail.note(tick_at(pose, DrivenBy.NOBODY))
    assert len(trail.since(0)[1]) == points


def test_each_event_is_marked_once_where_it_begins() -> None:
    trail = Trail()
    here = Pose(x_m=1.0, y_m=1.0, heading_rad=0.0)
    states: list[dict[str, Any]] = [
        {},
        {"asks": True},
        {"bumped": True},
        {"stalled": True},
        {"by": DrivenBy.PILOT},
    ]
    for state in 5 * states:
        for _ in range(3):
            trail.note(tick_at(here, **state))
    events = [event for point in trail.since(0)[1] for event in point.events]
    assert events == [Event.ASKED, Event.PUSHED, Event.CORRECTED] * 5


def test_teaching_is_no_correction_and_standing_at_a_wall_no_push() -> None:
    trail = Trail()
    here = Pose(x_m=1.0, y_m=1.0, heading_rad=0.0)
    trail.note(tick_at(here, DrivenBy.PILOT, mode=Mode.TRAIN))
    trail.note(tick_at(here, DrivenBy.NOBODY, mode=Mode.STOPPED, sent=Action.STOP, bumped=True))
    assert [point.events for point in trail.since(0)[1]] == [(), ()]
