"""The outcome of one tick, for the page and all other listeners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from robot.driver import Sensors
from robot.policy.events import HistoryEvent
from robot.types import Action, Decision, Frame, PilotCommand, Prediction, StopReason

LATE_CYCLE_S = 0.1
"""Duration above which a tick counts as late, in seconds."""
USUAL_PERIOD_S = 1 / 30
"""Camera period for which the link's limits are made, in seconds. If a camera's period is longer,
the excess is added to the limits."""


class LinkLevel(StrEnum):
    """Quality of the link, from good to unusable."""

    GOOD = "good"
    SLOW = "slow"  # the pilot is warned
    CAPPED = "capped"  # the robot also drives slower
    NOT_LEARNING = "not_learning"  # and does not learn, because labels could be wrong
    TOO_SLOW = "too_slow"  # the robot stops


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkState:
    """Estimates about the link and the computer, and the limits that follow from them."""

    level: LinkLevel = LinkLevel.GOOD
    age_s: float | None = None
    """Age of the picture that the pilot reacts to; None if the age is unknown."""
    is_busy: bool = False
    """True if this computer is late; the link may be fast."""
    must_stop: bool = False
    may_learn: bool = True
    """True if the robot may learn, because labels belong to the right pictures."""
    speed_scale: float = 1.0
    """Share of full speed that is allowed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraState:
    """Estimates about the camera, and the limits that follow from them."""

    period_s: float = USUAL_PERIOD_S
    delivery_age_s: float = 0.0
    """Age of the camera's pictures on arrival."""
    timeout_s: float = 0.2
    """Largest age of the newest picture while the robot may move."""
    speed_scale: float = 1.0
    """Share of full speed at which the robot does not travel too far before the next picture."""
    slack_s: float = 0.0
    """Excess of the camera's period over `USUAL_PERIOD_S`."""
    sight_slack_s: float = 0.0
    """Excess of two camera periods over 0.4 s. If one picture is lost, the next picture comes after
    two periods; the pilot does not count as blind before that."""


@dataclass(frozen=True, slots=True)
class Timing:
    """How often a step ran, and its total time."""

    count: int = 0
    total_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """The events of one tick, and the state of the loop at its end.

    `frame` is set if there is a new frame; `frame_id` and `frame_captured_s` belong to the newest
    frame. `is_resting` is True while the loop takes fewer frames because nobody needs more, and
    until the first frame after that. `source_age_s` is explained in `Camera`. `commands` holds the
    commands that the gate accepted; `refused` holds those that were too old or named no frame.
    """

    now_s: float
    decision: Decision
    sent: Action = Action.STOP
    frame: Frame | None = None
    commands: tuple[PilotCommand, ...] = ()
    refused: tuple[PilotCommand, ...] = ()
    prediction: Prediction | None = None
    sensors: Sensors = field(default_factory=Sensors)
    history_events: tuple[HistoryEvent, ...] = ()
    cycle_s: float = 0.0
    cycles: int = 0
    late_cycles: int = 0
    cycle_hz: float = 0.0
    frame_id: int | None = None
    frame_captured_s: float | None = None
    source_age_s: float | None = None
    is_resting: bool = False
    emergency: bool = False
    fault: str | None = None
    stops: Mapping[StopReason, int] = field(default_factory=dict)
    link: LinkState = field(default_factory=LinkState)
    camera: CameraState = field(default_factory=CameraState)
    agreement: float | None = None
    agreement_frames: int = 0
    taught: Mapping[Action, int] = field(default_factory=dict)
    n_nodes: int = 0
    max_nodes: int = 0
    learner: str = ""
    moves: tuple[Action, ...] = ()
    learner_times: Mapping[str, Timing] = field(default_factory=dict)


STEADY_S = 3.0
"""Minimum time for which the page shows a fault's sentence, in seconds: long enough to read it.
While the robot stands still, a fault that does not return within this time is over."""


class SteadyFault:
    """Chooses which fault's sentence the page shows while faults come and go. Pure.

    The first fault is shown immediately. Its sentence then stays for a while, even if the fault
    comes and goes once a second, or if its text changes because it counts seconds.
    """

    def __init__(self) -> None:
        self.shown: str | None = None
        self._changed_s = self._seen_s = -math.inf

    def show(self, fault: str | None, now_s: float, *, may_move: bool) -> str | None:
        """Note the current fault, and return the sentence that the page should show.

        If `may_move` is True, old faults are not shown, because the robot was started after them.
        """
        if fault is not None:
            self._seen_s = now_s
            is_due = self.shown is None or now_s - self._changed_s >= STEADY_S
            if is_due and fault != self.shown:
                self.shown, self._changed_s = fault, now_s
        elif may_move or now_s - self._seen_s >= STEADY_S:
            self.shown = None
        return self.shown
