"""A straight line through measurements over time, with the interval of its slope."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Slope(NamedTuple):
    """Growth of a figure per hour, and half the width of its 95 % interval."""

    hourly: float
    margin: float

    @property
    def is_flat(self) -> bool:
        """True if the interval includes no growth."""
        return abs(self.hourly) <= self.margin


def slope(times_s: ArrayLike, values: ArrayLike) -> Slope:
    """Fit a line by least squares; correlated neighbours widen the interval (Bartlett)."""
    t, y = np.asarray(times_s, float) / 3600, np.asarray(values, float)
    if len(t) < 4 or np.ptp(t) == 0:
        return Slope(math.nan, math.inf)
    hourly, start = np.polyfit(t, y, 1)
    rest = y - (hourly * t + start)
    spread = float((rest**2).sum())
    alike = float((rest[1:] * rest[:-1]).sum() / spread) if spread else 0.0
    alike = min(max(alike, 0.0), 0.95)
    deviation = math.sqrt(spread / (len(t) - 2) / (len(t) * float(t.var())))
    return Slope(float(hourly), 1.96 * deviation * math.sqrt((1 + alike) / (1 - alike)))
