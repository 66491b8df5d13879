"""The gaps of a lesson: what the pilot has to show the robot next."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from robot.types import Action, Frame


class Stage(StrEnum):
    """What the page asks the pilot to do next."""

    TEACH = "teach"
    TRY = "try"
    READY = "ready"


class GapKind(StrEnum):
    """The kind of a gap: missing teaching, or a mistake."""

    TOO_SHORT = "too_short"  # more teaching is needed
    RARE_MOVE = "rare_move"  # this move was begun too few times
    UNFORESEEN = "unforeseen"  # the pilot changed to this move, but the robot proposed another
    CORRECTED = "corrected"  # the pilot took the wheel here
    PUSHED = "pushed"  # the robot drove against an obstacle here
    HELPLESS = "helpless"  # the robot found no way out here
    UNKNOWN_VIEW = "unknown_view"  # the robot hardly knows this view


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """One situation to show the robot, and its location.

    `move` is the pilot's move there (None if unknown). `instead` is the move that the robot
    proposed.
    """

    kind: GapKind
    move: Action | None = None
    instead: Action | None = None
    have: float = 0.0
    need: float = 0.0
    distance_m: float | None = None
    frame: Frame | None = None
