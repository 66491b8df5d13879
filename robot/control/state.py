"""The outcome of one tick: a state for clients, a tick for the recorder; and who publishes both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from robot.control.camera_timing import CameraState, CameraTiming
from robot.control.link_governor import LinkGovernor, LinkLevel
from robot.control.online_learning import OnlineLearning, Timing
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


class StatePublisher:
    """Written on the loop's thread, read from any.

    Args:
        online_learning: Whose examples and predictions are shown.
        governor: Whose judgement of the link is shown.
        camera_timing: Whose estimates of the camera are shown.
        late_cycle_s: A tick that takes longer counts as late.
    """

    def __init__(
        self,
        online_learning: OnlineLearning,
        governor: LinkGovernor,
        camera_timing: CameraTiming,
        late_cycle_s: float,
    ) -> None:
        self._online_learning = online_learning
        self._governor = governor
        self._camera_timing = camera_timing
        self._late_cycle_s = late_cycle_s
        self._listeners: list[Callable[[Tick], None]] = []
        self._stops: Counter[StopReason] = Counter()
        self._cycles = 0
        self._late_cycles = 0
        self._state: LoopState

    @property
    def state(self) -> LoopState:
        """The newest state; a frozen value that never changes under the reader."""
        return self._state

    def subscribe(self, listener: Callable[[Tick], None]) -> Callable[[], None]:
        """Have `listener` called after each tick; return a function that ends that."""
        self._listeners = [*self._listeners, listener]

        def unsubscribe() -> None:
            self._listeners = [other for other in self._listeners if other is not listener]

        return unsubscribe

    def count_stop(self, reason: StopReason) -> None:
        """Count one stop of a robot that could move."""
        self._stops[reason] += 1

    def publish(self, tick: Tick, *, emergency: bool, fault: str | None) -> None:
        """Publish the outcome of a tick: the new state, and the tick to every listener."""
        self._cycles += 1
        self._late_cycles += tick.cycle_s > self._late_cycle_s
        self.show(tick.now_s, tick.decision, tick.sensors, emergency=emergency, fault=fault)
        for listener in self._listeners:
            listener(tick)

    def show(
        self,
        now_s: float,
        decision: Decision,
        sensors: Sensors,
        *,
        emergency: bool = False,
        fault: str | None = None,
    ) -> None:
        """Publish a new state."""
        online_learning = self._online_learning
        frame, policy = online_learning.frame, online_learning.history.policy
        self._state = LoopState(
            now_s=now_s,
            decision=decision,
            emergency=emergency,
            fault=fault,
            frame_id=frame.frame_id if frame else None,
            frame_captured_s=frame.captured_s if frame else None,
            prediction=online_learning.prediction,
            sensors=sensors,
            cycle_hz=online_learning.frame_rate_hz,
            late_cycles=self._late_cycles,
            cycles=self._cycles,
            agreement=online_learning.agreement.share,
            agreement_frames=online_learning.agreement.n_examples,
            taught=dict(online_learning.history.taught),
            n_nodes=policy.n_nodes,
            max_nodes=policy.max_nodes,
            learner=policy.name,
            moves=policy.moves,
            stops=dict(self._stops),
            link=self._governor.level,
            is_busy=self._governor.is_busy,
            camera=self._camera_timing.state,
            pilot_frame_age_s=self._governor.age_s,
            learner_times=dict(online_learning.timings),
        )
