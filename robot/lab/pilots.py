"""The pilot that a task describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.lab.ideas import make_teacher
from robot.lab.simulated_pilots.hand import STEADY, HumanDelayConfig
from robot.lab.simulated_pilots.pilot import SimulatedPilot, TakeoverPolicy
from robot.types import Action


def make_pilot(params: Mapping[str, Any], moves: tuple[Action, ...]) -> SimulatedPilot:
    """Build it from `teacher`, `seed`, and if there are `delay_ms`, `names_frame`, `lenience`.

    The sonar controller is a program on the robot, so it has no human delay and no link.
    """
    delay_s = params.get("delay_ms", 0) / 1000
    hand = HumanDelayConfig(link_delay_s=delay_s, names_frame=params.get("names_frame", True))
    return SimulatedPilot(
        make_teacher(params["teacher"], moves),
        moves,
        hand=STEADY if params["teacher"] == "sonar" else hand,
        takeover=TakeoverPolicy(lenience=params.get("lenience", TakeoverPolicy().lenience)),
        seed=str(params["seed"]),
    )
