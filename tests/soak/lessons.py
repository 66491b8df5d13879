"""A school year of lessons in virtual time: the cost of the learner's step, and the stored data."""

from __future__ import annotations

import gc
import time
from statistics import median

import numpy as np

from robot.policy.registry import make_policy
from robot.types import DEFAULT_MOVES

_AT_ONCE = 1000


def year(lessons: int) -> str:
    """Teach this number of lessons, with views that change from hour to hour; return the costs."""
    chance, policy = np.random.default_rng(1), make_policy("default-32", DEFAULT_MOVES)
    views = chance.normal(size=(64, 768))
    steps_us: list[float] = []
    objects: list[int] = []
    for number in range(lessons):
        if number % 500 == 0:
            views += 0.05 * chance.normal(size=views.shape)
        at = int(chance.integers(len(views)))
        x = (views[at] + 0.3 * chance.normal(size=768)).astype(np.float32)
        began_s = time.thread_time()
        policy.learn(x, DEFAULT_MOVES[at % 3], number / 5)
        steps_us.append(1e6 * (time.thread_time() - began_s))
        if number % _AT_ONCE == _AT_ONCE - 1:
            gc.collect()
            objects.append(len(gc.get_objects()))
    first, last = (median(part) for part in (steps_us[1000:3000], steps_us[-2000:]))
    return (
        f"{lessons} lessons in virtual time: a step {first:.0f} us at first, {last:.0f} us at "
        f"last; objects {objects[0]} after {_AT_ONCE}, {objects[-1]} at last"
    )
