"""The frames and examples that pass through the parts of a policy, one part after another.

Each part reads the results of the earlier parts, and adds its own.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Evidence, Vector
from robot.learner.part import Stateful
from robot.types import Action, Point

USUAL_STEP_S = 0.1
"""Time that is assumed between two frames if the actual time is unknown, in seconds."""
_NOTHING = Evidence(label="", probabilities={}, confidence=0.0)


@dataclass(slots=True, kw_only=True)
class Seen:
    """A frame that passes through the parts: the arguments of `Policy.propose`, and the results.

    Attributes:
        number: The frame's number, counted by the policy.
        x: The vector that is shown to the learner.
        picture: The frame's grey values, not adapted to the light.
        step_s: Time since the previous frame was taken, in seconds.
        in_context: True if the votes depend on the current move.
        context: The context of the current move; None if all contexts count.
        evidence: The learner's prediction.
        shares: The votes for each move; the filter smooths them.
        action: The proposed move.
        kept: Weight of the earlier frames in the running averages of votes at this frame.
        point: The proposed steering and throttle, if the pilot taught with proportional steering.
        spread: Standard deviation of the steering of `point`.
    """

    number: int
    x: Vector
    picture: NDArray[np.uint8]
    at_s: float = 0.0
    step_s: float = USUAL_STEP_S
    under_way: Action | None = None
    bumped: bool = False
    takes_points: bool = True
    in_context: bool = False
    context: int | None = None
    evidence: Evidence = _NOTHING
    shares: dict[Action, float] = field(default_factory=dict)
    action: Action = Action.STOP
    is_stalled: bool = False
    needs_help: bool = False
    kept: float = 0.0
    point: Point | None = None
    spread: float | None = None


@dataclass(slots=True, kw_only=True)
class TaughtExample:
    """An example that passes through the parts: the arguments of `Policy.learn`, and the results.

    Attributes:
        number: The example's number, counted by the policy.
        picture: The frame's grey values.
        is_learned: False if the example is only counted (`example_selection.py`).
        contexts: The contexts in which the example counts; a part may set them.
    """

    number: int
    x: Vector
    picture: NDArray[np.uint8]
    label: Action
    at_s: float | None = None
    point: Point | None = None
    is_learned: bool = True
    contexts: Collection[int] = ()


class PolicyPart(Stateful):
    """Base class of a policy's parts."""

    counts_all: ClassVar[bool] = False
    """True if the part also gets the examples that the learner does not learn."""

    def on_frame(self, seen: Seen) -> None:
        """Process one frame, and add this part's results to `seen`."""

    def on_example(self, lesson: TaughtExample) -> None:
        """Learn one example. A part may change `lesson` for the parts after it."""

    def reset(self) -> None:
        """Forget the state of the last drive, because a new drive begins."""
