"""Publishes the outcome of each tick: the newest state, and the tick itself to listeners."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from robot.control.camera_timing import CameraTiming
from robot.control.link_governor import LinkGovernor
from robot.control.online_learning import OnlineLearning
from robot.control.state import LoopState, Tick
from robot.types import Decision, Sensors, StopReason


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
