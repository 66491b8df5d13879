"""Which move an action of LeRobot counts as. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping

ACTION = ("steering.pos", "throttle.vel")
"""What is done, and asked for: lerobot-rollout passes on such endings only."""
STANDS = (0.0, 0.0)


def nearest(asked: Mapping[str, float], points: Mapping[str, tuple[float, float]]) -> str | None:
    """Return the nearest of some moves that drive the same way; None stands.

    A throttle nearer to zero than to that of any move ahead (or back) is a stop, unless a move that
    turns on the spot is near. An action that names no throttle is a stop, too: when a rollout
    ends, LeRobot brings back what ends in `.pos`, and says nothing of the throttle.

    Args:
        asked: `steering.pos` and `throttle.vel`, each from -1 to 1; what is no number is a stop.
        points: Steering and throttle of each move that the robot takes.
    """
    steering_name, throttle_name = ACTION
    throttle = float(asked.get(throttle_name, math.nan))
    steering = float(asked.get(steering_name, 0.0))
    if not (math.isfinite(throttle) and math.isfinite(steering)):
        return None
    way = math.copysign(1.0, throttle)
    same_way = {name: at for name, at in points.items() if way * at[1] > 0.0}
    least = min((abs(at[1]) for at in same_way.values()), default=math.inf)
    if abs(throttle) < least / 2:
        on_the_spot = {name: at for name, at in points.items() if at[1] == 0.0}
        choice: dict[str | None, tuple[float, float]] = {None: STANDS, **on_the_spot}
    else:
        choice = dict(same_way)
    # Beyond its ends an action is what lies there; else a far one would be near to nothing.
    at = max(-1.0, min(1.0, steering)), max(-1.0, min(1.0, throttle))
    return min(choice, key=lambda name: math.dist(choice[name], at))
