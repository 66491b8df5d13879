"""The outcome of one tick: a state for clients, a tick for the recorder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robot.control.camera_timing import CameraState
from robot.control.link_governor import LinkLevel
from robot.policy.history import HistoryEvent
from robot.types import (
    Action,
    Decision,
    Frame,
    PilotCommand,
    Prediction,
    Sensors,
    StopReason,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """How often something was done, and how long it took in all."""

    count: int = 0
    total_s: float = 0.0

    def plus(self, seconds: float) -> Timing:
        """Return this with one more."""
        return Timing(count=self.count + 1, total_s=self.total_s + seconds)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopState:
    """What the loop last did and sees: one consistent snapshot for clients and metrics."""

    now_s: float
    decision: Decision
    emergency: bool
    fault: str | None
    frame_id: int | None
    frame_captured_s: float | None
    prediction: Prediction | None
    sensors: Sensors
    cycle_hz: float
    late_cycles: int
    cycles: int
    agreement: float | None
    agreement_frames: int
    taught: Mapping[Action, int]
    n_nodes: int
    max_nodes: int
    learner: str
    moves: tuple[Action, ...]
    stops: Mapping[StopReason, int]
    link: LinkLevel = LinkLevel.GOOD
    is_busy: bool = False
    camera: CameraState = field(default_factory=CameraState)
    pilot_frame_age_s: float | None = None
    learner_times: Mapping[str, Timing] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """All that happened in one tick. `frame` is set if it was a new one.

    `commands` count; `refused` are those that the gate found too old, or that name no frame.
    """

    now_s: float
    frame: Frame | None
    commands: tuple[PilotCommand, ...]
    refused: tuple[PilotCommand, ...]
    decision: Decision
    sent: Action
    prediction: Prediction | None
    sensors: Sensors
    history_events: tuple[HistoryEvent, ...]
    cycle_s: float
