"""The outcome of one tick, for the page and all other listeners."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from robot.control.camera_timing import CameraState
from robot.control.link_governor import LinkState
from robot.control.online_learning import Timing
from robot.policy.events import HistoryEvent
from robot.types import Action, Decision, Frame, PilotCommand, Prediction, Sensors, StopReason

LATE_CYCLE_S = 0.1
"""Duration above which a tick counts as late, in seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """The events of one tick, and the state of the loop at its end.

    `frame` is set if there is a new frame; `frame_id` and `frame_captured_s` belong to the newest
    frame. `source_age_s` is explained in `Camera`. `commands` are the commands that the gate
    accepted; `refused` holds the commands that were too old or named no frame.
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
"""Least time for which a fault's sentence is shown, in seconds: long enough to read it. While the
robot stands still, a fault that does not return within this time is over."""


class SteadyFault:
    """Chooses which fault's sentence the page shows while faults come and go. Pure.

    A new fault is shown immediately. The fault's sentence then stays, even if the fault comes and
    goes once a second, or if its text changes because it counts seconds.
    """

    def __init__(self) -> None:
        self.shown: str | None = None
        self._changed_s = self._seen_s = -math.inf

    def show(self, fault: str | None, now_s: float, *, may_move: bool) -> str | None:
        """Note the current fault, and return the sentence that the page should show.

        If the robot `may_move`, it was started after all old faults, which are no longer shown.
        """
        if fault is not None:
            self._seen_s = now_s
            is_due = self.shown is None or now_s - self._changed_s >= STEADY_S
            if is_due and fault != self.shown:
                self.shown, self._changed_s = fault, now_s
        elif may_move or now_s - self._seen_s >= STEADY_S:
            self.shown = None
        return self.shown
