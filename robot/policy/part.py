"""The frames and examples that pass through the parts of a policy, one part after another.

Each part reads what the parts before it found, and adds what it knows.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot.learner.base import Evidence, Vector
from robot.learner.part import Stateful
from robot.types import Action, Point

USUAL_STEP_S = 0.1
"""Time between two frames where nothing tells it."""
_NOTHING = Evidence(label="", probabilities={}, confidence=0.0)


@dataclass(slots=True, kw_only=True)
class Seen:
    """A frame on its way: what `Policy.propose` is told of it, and what the parts make of it.

    Attributes:
        number: Which frame of the policy it is.
        x: Its vector, as the learner is shown it.
        picture: Its grey values, as they were taken.
        step_s: How long it was taken after the one before.
        in_context: Votes are for what follows the move under way.
        context: Which context that move makes; None: any.
        evidence: The learner's prediction.
        shares: The votes for each move; the filter makes them steady.
        action: The move to make.
        kept: How much of the average before it is left in that of the votes.
        point: The action by degrees, if the pilot taught by degrees.
        spread: By how much its steering is off.
    """

    number: int
    x: Vector
    picture: NDArray[np.uint8]
    at_s: float = 0.0
    step_s: float = USUAL_STEP_S
    under_way: Action | None = None
    bumped: bool = False
    by_degrees: bool = True
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
    """An example on its way: what `Policy.learn` is told of it, and how it is learned.

    Attributes:
        number: Which example of the policy it is.
        picture: The frame's grey values.
        is_learned: False for one that is only counted (`move_context.py`, `repeats.py`).
        contexts: In which contexts it counts, if a part knows.
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
    """Base of a policy's parts."""

    def on_frame(self, seen: Seen) -> None:
        """Add to what is known of a frame."""

    def on_example(self, lesson: TaughtExample) -> None:
        """Learn one example, or say how the parts after this one do."""

    def reset(self) -> None:
        """Forget what belongs to one drive: a new drive begins."""
