"""Timeouts that adapt to the camera's measured period and to the age of its pictures. Pure.

A webcam on a fast bus delivers thirty pictures a second, each 5 ms old. On a slow computer, the
same webcam delivers ten pictures a second, each 95 to 145 ms old. No fixed limit suits both. The
limits are quantiles over the last pictures, so one lost picture does not change them. The limits
shrink quickly, but grow slowly while the robot moves. No limit may let the robot travel too far
without a newer picture.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from itertools import accumulate

from robot.control.config import CameraTimingConfig
from robot.control.state import USUAL_PERIOD_S, CameraState

SLOW_PERIOD_S = 0.75
"""Period in seconds above which a camera is reported as too slow. Nobody can steer with so few
pictures. Webcams usually deliver ten to thirty pictures a second."""
_LEAST_SCALE = 0.05
"""Lower bound of the speed scale. Bodies refuse a scale of 0. No camera needs a lower scale."""


class CameraTiming:
    """Estimates a camera's period and the age at which its pictures arrive. `state` holds the
    estimates and limits; its timeout is never less than `shortest_timeout_s`."""

    _WINDOW = 15
    _AGE_QUANTILE = 0.8
    _MISSED_PERIODS = 2.5
    """The timeout allows a gap of this many periods between two pictures. If one picture is lost,
    the gap is two periods; half a period is added for jitter."""

    def __init__(self, shortest_timeout_s: float, config: CameraTimingConfig | None = None) -> None:
        self.config = config or CameraTimingConfig()
        self._shortest_timeout_s = shortest_timeout_s
        self._periods_s: deque[float] = deque(maxlen=self._WINDOW)
        self._ages_s: deque[float] = deque(maxlen=self._WINDOW)
        self._captured_s = self._noted_s = math.inf  # infinite until there is a picture
        self.state = self._judge(USUAL_PERIOD_S, 0.0)
        self.fault: str | None = None
        """Sentence for a camera that delivers pictures, but too few of them to drive by."""

    def note(self, captured_s: float, delivered_s: float, *, is_moving: bool) -> None:
        """Record a new picture: the time of its capture, and the time of its arrival at the loop.

        While the robot may move (`is_moving`), estimates grow slowly.
        """
        gap_s = captured_s - self._captured_s
        if 0.0 < gap_s <= self.config.full_speed_s / _LEAST_SCALE:  # a longer gap counts as a pause
            self._periods_s.append(gap_s)
        self._captured_s = captured_s
        self._ages_s.append(max(0.0, delivered_s - captured_s))
        elapsed_s = max(0.0, delivered_s - self._noted_s)
        self._noted_s = delivered_s
        growth_s = self.config.growth_s_per_s * elapsed_s if is_moving else math.inf
        before = self.state
        period_s = _typical(self._periods_s) if self._periods_s else before.period_s
        self.fault = None
        if len(self._periods_s) >= 2 and period_s >= SLOW_PERIOD_S:
            self.fault = (
                f"The camera delivers only one picture every {period_s:.1f} s, so the robot stops "
                "or drives slowly. Check the light, the camera's connection, and its device's load."
            )
        self.state = self._judge(
            min(period_s, before.period_s + growth_s),
            min(_quantile(self._ages_s, self._AGE_QUANTILE), before.delivery_age_s + growth_s),
        )

    @property
    def rate_hz(self) -> float:
        """Mean number of new pictures per second, without pauses; 0 before the second picture."""
        return len(self._periods_s) / sum(self._periods_s) if self._periods_s else 0.0

    def pause(self) -> None:
        """Ignore the time until the next picture, because it is not the camera's period."""
        self._captured_s = math.inf

    def _judge(self, period_s: float, delivery_age_s: float) -> CameraState:
        longest_s = max(self.config.longest_timeout_s, self._shortest_timeout_s)
        longest_s += max(0.0, period_s - self.config.full_speed_s)
        wanted_s = delivery_age_s + self._MISSED_PERIODS * period_s
        full_speed_share = self.config.full_speed_s / (delivery_age_s + period_s)
        return CameraState(
            period_s=period_s,
            delivery_age_s=delivery_age_s,
            timeout_s=min(max(wanted_s, self._shortest_timeout_s), longest_s),
            speed_scale=min(1.0, max(_LEAST_SCALE, full_speed_share)),
            slack_s=max(0.0, period_s - USUAL_PERIOD_S),
            sight_slack_s=2 * max(0.0, period_s - 1 / 5),
        )


def _typical(periods_s: deque[float]) -> float:
    """Return the time-weighted lower quartile of the periods. Lost pictures hardly change the
    quartile, but pauses between bursts of pictures do."""
    ordered = sorted(periods_s)
    passed_s = list(accumulate(ordered))
    return ordered[bisect_left(passed_s, passed_s[-1] / 4)]


def _quantile(values: deque[float], share: float) -> float:
    """Return the value below which about `share` of the values lie."""
    return sorted(values)[int(share * len(values))]
