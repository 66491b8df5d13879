"""Finds the robot's move that is nearest to a LeRobot action. Pure code."""

from __future__ import annotations

import math
from collections.abc import Mapping

ACTION = ("steering.pos", "throttle.vel")
"""The names of an action's values. lerobot-rollout forwards only names with these endings."""
STANDS = (0.0, 0.0)


def nearest(asked: Mapping[str, float], points: Mapping[str, tuple[float, float]]) -> str | None:
    """Return the nearest move in the same direction (ahead or back); None means stop.

    If the throttle is less than half the smallest throttle in its direction, return a turn on the
    spot or None, whichever is nearer. An action without a throttle is a stop: at the end of a
    rollout, LeRobot restores only the values whose names end in `.pos`.

    Args:
        asked: `steering.pos` and `throttle.vel`, each from -1 to 1; a non-finite value is a stop.
        points: Steering and throttle of each move that the robot accepts.
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
    # Clip values to the range; otherwise they would seem distant from every move.
    at = max(-1.0, min(1.0, steering)), max(-1.0, min(1.0, throttle))
    return min(choice, key=lambda name: math.dist(choice[name], at))
