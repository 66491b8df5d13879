"""Compensates for changed light: scales each view to the brightness of the lesson.

Directions of gradients hardly change with the light, but grey values do. The light is measured as
the mean brightness of some seconds of driving, because a dark corner hardly changes this mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Vector
from robot.learner.part import Value
from robot.learner.values import number
from robot.policy.part import PolicyPart, Seen, TaughtExample

ANOTHER_LIGHT = 1.5
"""Factor of brightness, up or down, from which the light counts as changed. Smaller differences are
due to the view."""
SECONDS = 3.0
"""Driving time over which the brightness is averaged, in seconds."""
EXAMPLES = 600.0
"""Number of examples over which the lesson's brightness is averaged."""


class LightAdaptation(PolicyPart):
    """Compares a drive's brightness with that of the examples, in constant time per frame.

    Args:
        brighten: Returns a view with its grey values multiplied by a factor.
    """

    fields = (Value("taught", number(0.0, 255.0)), Value("examples", number(0.0, EXAMPLES)))

    def __init__(self, brighten: Callable[[Vector, float], Vector]) -> None:
        self._brighten = brighten
        self._taught = self._examples = 0.0
        self._driven: float | None = None

    def on_frame(self, seen: Seen) -> None:
        brightness = _brightness(seen.picture)
        driven = brightness if self._driven is None else self._driven
        driven += (1.0 - math.exp(-seen.step_s / SECONDS)) * (brightness - driven)
        self._driven = driven
        gain = self._taught / max(driven, 1.0)
        if self._examples and not 1.0 / ANOTHER_LIGHT <= gain <= ANOTHER_LIGHT:
            seen.x = self._brighten(seen.x, gain)

    def on_example(self, lesson: TaughtExample) -> None:
        self._examples = min(self._examples + 1.0, EXAMPLES)
        self._taught += (_brightness(lesson.picture) - self._taught) / self._examples

    def reset(self) -> None:
        self._driven = None

    def restored(self) -> None:
        self.reset()


def _brightness(picture: NDArray[np.uint8]) -> float:
    """Return the mean grey value; `mean()` takes twice as long."""
    return float(picture.sum()) / max(picture.size, 1)
