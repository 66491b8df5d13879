"""Passes frames and examples with a test's values through one part of a policy."""

from __future__ import annotations

from typing import Any

import numpy as np

from robot.policy.part import PolicyPart, Seen, TaughtExample
from robot.types import Action

_NOTHING = np.zeros(1200, np.uint8)


def see(part: PolicyPart, **known: Any) -> Seen:
    """Show a part one frame, and return the processed frame."""
    picture = known.setdefault("picture", _NOTHING)
    seen = Seen(**{"number": 1, "x": picture, **known})
    part.on_frame(seen)
    return seen


def teach(part: PolicyPart, label: Action, at_s: float | None, **known: Any) -> TaughtExample:
    """Teach a part one example, and return the processed example."""
    picture = known.setdefault("picture", _NOTHING)
    lesson = TaughtExample(**{"number": 1, "x": picture, "label": label, "at_s": at_s, **known})
    part.on_example(lesson)
    return lesson
