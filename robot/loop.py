"""The control loop: newest frame, features, policy, gate, drive; and only then learning.

`ControlLoop.tick` is one turn of it, with time as an argument, and does no waiting: experiments
call it directly, as fast as they can. `LoopThread` is the thin shell that calls it in real time,
at once for each new frame or command and every 50 ms without them, and never waits for a network.
"""

from __future__ import annotations

import logging
import threading
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import TypeVar

from robot.camera import Camera
from robot.clock import Clock
from robot.driver import BodyButton, Driver
from robot.errors import CameraError, DriveError
from robot.gate import Gate, GateConfig
from robot.governor import Governor, GovernorConfig, age_of_link_s
from robot.labels import Labeller
from robot.learner.base import Vector
from robot.policy import Policy
from robot.school import Replaced, School, SchoolEvent
from robot.state import LoopState, Tick, Timing
from robot.types import (
    Action,
    Decision,
    DrivenBy,
    Frame,
    Lesson,
    Mode,
    PilotCommand,
    Prediction,
    Sensors,
    StopReason,
)

log = logging.getLogger(__name__)
_T = TypeVar("_T")

AGREEMENT_FRAMES = 100
"""Over how many of the last lessons agreement is counted."""
MEMORY_FRAMES = 64
"""How many of the newest frames can still be labelled: two seconds at 30 frames a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig:
    """What the loop does, and how patient it is."""

    gate: GateConfig = field(default_factory=GateConfig)
    governor: GovernorConfig = field(default_factory=GovernorConfig)
    longest_wait_s: float = 0.05
    """A turn is made at least so often, even when the camera is silent."""
    late_cycle_s: float = 0.1
    """A turn that takes longer counts as late."""
    stall_s: float = 0.3
    """After a longer gap between two turns the robot stops: whatever the pilot said meanwhile is
    of the past (the computer slept, or the process was held up)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Seen:
    """A frame that can still be labelled."""

    x: Vector
    captured_s: float
    predicted: Action | None


class ControlLoop:
    """One robot's loop. `tick` is for one thread; all other methods may be called from any.

    `speed_share`, in (0, 1], is how much of full speed a person allows.
    """

    def __init__(
        self,
        driver: Driver,
        camera: Camera,
        policy: Policy,
        clock: Clock,
        config: LoopConfig | None = None,
    ) -> None:
        self.config = config or LoopConfig()
        self.wake = threading.Event()
        self._driver = driver
        self._camera = camera
        self._clock = clock
        self._gate = Gate(self.config.gate)
        self._governor = Governor(self.config.governor)
        self._labeller = Labeller()
        self._events: list[SchoolEvent] = []
        self.school = School(policy, self._events.append)
        self._lock = threading.Lock()
        self._inbox: list[PilotCommand] = []
        self._requests: deque[Callable[[], None]] = deque()
        self._listeners: list[Callable[[Tick], None]] = []
        self._seen: dict[int, _Seen] = {}
        self._frame: Frame | None = None
        self._prediction: Prediction | None = None
        self._agreed: deque[bool] = deque(maxlen=AGREEMENT_FRAMES)
        self._frame_times_s: deque[float] = deque(maxlen=30)
        self._stops: Counter[StopReason] = Counter()
        self._cycles = 0
        self._late_cycles = 0
        self._last_turn_s: float | None = None
        self._timings = {"propose": Timing(), "learn": Timing()}
        self._fault: str | None = None
        self._last_mode = Mode.TRAIN
        self._shown_mode = Mode.STOPPED
        self.speed_share = 1.0
        self._state = self._make_state(clock.now_s(), self._idle_decision(), Sensors())
        camera.listen(self.wake.set)

    # What others ask of the loop -------------------------------------------------------------

    @property
    def state(self) -> LoopState:
        """The newest state; a frozen value that never changes under the reader."""
        return self._state

    def command(self, command: PilotCommand) -> None:
        """Take one word of the pilot; the loop turns at once."""
        with self._lock:
            self._inbox.append(command)
        self.wake.set()

    def set_mode(self, mode: Mode) -> Future[bool]:
        """Choose a mode: the explicit start after any stop. The future says if it was taken."""
        return self.submit(lambda: self._start(mode))

    def empty_command(self) -> Future[None]:
        """Forget what is held: the pilot joined, left or lost the wheel. Stops a moving robot."""
        return self.submit(self._change_pilot)

    def trip(self, reason: StopReason) -> Future[None]:
        """Stop and wait for an explicit start."""
        return self.submit(lambda: self._trip(reason))

    def latch_emergency(self) -> Future[None]:
        """Stop until `release_emergency`."""
        return self.submit(self._latch_emergency)

    def release_emergency(self) -> Future[None]:
        """Let modes be chosen again; the robot goes on standing."""
        return self.submit(self._gate.release_emergency)

    def submit(self, request: Callable[[], _T]) -> Future[_T]:
        """Have `request` run between two turns, on the loop's own thread.

        Whatever reads or changes the school goes this way: undo, edits, saving, replacing.
        """
        future: Future[_T] = Future()

        def run() -> None:
            try:
                future.set_result(request())
            except Exception as error:  # handed to whoever asked; the loop goes on
                future.set_exception(error)

        with self._lock:
            self._requests.append(run)
        self.wake.set()
        return future

    def subscribe(self, listener: Callable[[Tick], None]) -> Callable[[], None]:
        """Have `listener` told of each turn, on the loop's thread; it must only take note.

        Returns:
            A function that ends the subscription.
        """
        self._listeners = [*self._listeners, listener]

        def unsubscribe() -> None:
            self._listeners = [other for other in self._listeners if other is not listener]

        return unsubscribe

    # One turn --------------------------------------------------------------------------------

    def tick(self, now_s: float) -> Tick:
        """Make one turn. Never raises: what goes wrong stops the robot and is said in `state`."""
        started_s = self._clock.now_s()
        try:
            return self._turn(now_s, started_s)
        except Exception as error:  # top of the loop: whatever it is, first of all stop
            self._driver.stop()
            log.exception("the loop stopped the robot")
            self._trip(StopReason.LOOP_FAULT)
            self._fault = f"Something went wrong inside: {error}"
            return self._finish(now_s, started_s, None, [], self._idle_decision(), Action.STOP)

    def _turn(self, now_s: float, started_s: float) -> Tick:
        self._check_stall(now_s)
        self._serve_requests()
        self._heed_button()
        commands = self._hear(now_s)
        frame = self._look()
        sensors = self._sense()
        decision = self._decide(now_s)
        sent = self._drive(decision)
        if sent is None:
            decision, sent = self._idle_decision(), Action.STOP
        if decision.driven_by is DrivenBy.PILOT or self._gate.mode is not Mode.STOPPED:
            self._learn(commands)
        return self._finish(now_s, started_s, frame, commands, decision, sent, sensors)

    def _serve_requests(self) -> None:
        while True:
            with self._lock:
                if not self._requests:
                    return
                request = self._requests.popleft()
            request()

    def _check_stall(self, now_s: float) -> None:
        before_s, self._last_turn_s = self._last_turn_s, now_s
        if self._gate.mode is Mode.STOPPED or before_s is None:
            return
        if now_s - before_s > self.config.stall_s:
            self._trip(StopReason.LOOP_FAULT)
            self._fault = f"The robot's computer was held up for {now_s - before_s:.1f} s."

    def _heed_button(self) -> None:
        """Obey a button on the robot itself: any stops it, the start button starts it again."""
        button = self._driver.take_button()
        if button is BodyButton.START and self._gate.mode is Mode.STOPPED:
            self._start(self._last_mode)
        elif button is not None:
            self._trip(StopReason.BUTTON)

    def _hear(self, now_s: float) -> list[PilotCommand]:
        with self._lock:
            commands, self._inbox = self._inbox, []
        for command in commands:
            self._judge_link(command, now_s)
        if self._governor.must_stop:
            self._trip(StopReason.LINK_SLOW)
        if self._gate.mode is Mode.STOPPED:
            return []
        for command in commands:
            self._gate.hear(command)
        return commands

    def _judge_link(self, command: PilotCommand, now_s: float) -> None:
        """Have the governor weigh how old the picture is that the pilot acts upon."""
        if command.frame_id is None or not self._seen:
            return
        oldest = next(iter(self._seen.values()))
        captured_s = self._seen.get(command.frame_id, oldest).captured_s
        age_s = age_of_link_s(command.received_s - captured_s, command.frame_age_s)
        self._governor.hear(age_s, now_s)

    def _look(self) -> Frame | None:
        """Take the newest frame, and return it if the policy has not seen it yet."""
        frame = self._camera.latest()
        if frame is None or (self._frame is not None and frame.frame_id == self._frame.frame_id):
            return None
        try:
            x = self.school.policy.extract(frame)
        except CameraError as error:
            self._fault = str(error)
            return None
        self._frame = frame
        self._frame_times_s.append(frame.captured_s)
        started_s = self._clock.now_s()
        self._prediction = self.school.policy.propose(frame.frame_id, x)
        self._note_time("propose", started_s)
        self._seen[frame.frame_id] = _Seen(
            x=x, captured_s=frame.captured_s, predicted=self._prediction.action
        )
        while len(self._seen) > MEMORY_FRAMES:
            del self._seen[next(iter(self._seen))]
        return frame

    def _sense(self) -> Sensors:
        try:
            return self._driver.sense()
        except DriveError as error:
            self._drive_failed(error)
            return Sensors()

    def _decide(self, now_s: float) -> Decision:
        was_moving = self._gate.mode is not Mode.STOPPED
        decision = self._gate.select(
            now_s,
            self._prediction,
            self._frame.captured_s if self._frame else None,
            camera_fault=self._camera.fault is not None,
        )
        if was_moving and decision.mode is Mode.STOPPED and decision.stop_reason is not None:
            self._note_stop(decision.stop_reason)
        scale = min(decision.speed_scale, self._governor.speed_scale) * self.speed_share
        return replace(decision, speed_scale=scale)

    def _drive(self, decision: Decision) -> Action | None:
        """Send the decision to the motors; None if they failed, after a try to stop them."""
        try:
            return self._driver.send_action(decision.action, speed_scale=decision.speed_scale)
        except DriveError as error:
            self._drive_failed(error)
            return None

    def _learn(self, commands: list[PilotCommand]) -> None:
        """Teach the frames that the pilot's commands label; a stopped robot does not learn."""
        is_intervention = self._gate.mode is Mode.AUTONOMOUS
        for command in commands:
            for frame_id, label in list(self._labeller.label(command, self._seen)):
                if not self._governor.may_learn:
                    continue
                seen = self._seen[frame_id]
                lesson = Lesson(frame_id=frame_id, label=label, is_intervention=is_intervention)
                self._agreed.append(seen.predicted is label)
                started_s = self._clock.now_s()
                self.school.teach(lesson, seen.x, seen.captured_s)
                self._note_time("learn", started_s)

    def _note_time(self, name: str, started_s: float) -> None:
        self._timings[name] = self._timings[name].plus(self._clock.now_s() - started_s)

    def _finish(
        self,
        now_s: float,
        started_s: float,
        frame: Frame | None,
        commands: list[PilotCommand],
        decision: Decision,
        sent: Action,
        sensors: Sensors | None = None,
    ) -> Tick:
        cycle_s = self._clock.now_s() - started_s
        self._cycles += 1
        self._late_cycles += cycle_s > self.config.late_cycle_s
        sensors = sensors or Sensors()
        tick = Tick(
            now_s=now_s,
            frame=frame,
            commands=tuple(commands),
            decision=decision,
            sent=sent,
            prediction=self._prediction,
            sensors=sensors,
            school_events=tuple(self._events),
            cycle_s=cycle_s,
        )
        if any(isinstance(event, Replaced) for event in self._events):
            self._agreed.clear()  # another policy: how good the one before was says nothing
        self._events.clear()
        if decision.mode is not self._shown_mode:
            self._shown_mode = decision.mode
            self._driver.show(decision.mode)
        self._state = self._make_state(now_s, decision, sensors)
        for listener in self._listeners:
            listener(tick)
        return tick

    # What requests do, on the loop's thread ----------------------------------------------------

    def _start(self, mode: Mode) -> bool:
        if mode is Mode.STOPPED:
            self._trip(StopReason.PILOT_ASKED)
            return True
        self._settle()
        self._fault = None
        self._last_mode = mode
        return self._gate.start(mode, self._clock.now_s())

    def _change_pilot(self) -> None:
        self._trip(StopReason.PILOT_GONE)
        self._governor.forget()

    def _trip(self, reason: StopReason) -> None:
        if self._gate.mode is not Mode.STOPPED:
            self._note_stop(reason)
        self._gate.trip(reason)
        self._settle()

    def _latch_emergency(self) -> None:
        self._trip(StopReason.EMERGENCY)
        self._gate.latch_emergency()
        self._driver.stop()

    def _settle(self) -> None:
        """Forget whatever belongs to the drive that ends here."""
        with self._lock:
            self._inbox.clear()
        self._labeller.settle()
        self.school.policy.settle()

    def _note_stop(self, reason: StopReason) -> None:
        self._stops[reason] += 1
        self._settle()
        log.info("stop reason=%s", reason.value)

    def _drive_failed(self, error: DriveError) -> None:
        self._fault = str(error)
        self._trip(StopReason.DRIVE_FAULT)
        self._driver.stop()

    # What others see ---------------------------------------------------------------------------

    def _idle_decision(self) -> Decision:
        return Decision(
            action=Action.STOP,
            driven_by=DrivenBy.NOBODY,
            mode=Mode.STOPPED,
            stop_reason=self._gate.stop_reason,
        )

    def _make_state(self, now_s: float, decision: Decision, sensors: Sensors) -> LoopState:
        frame, policy = self._frame, self.school.policy
        return LoopState(
            now_s=now_s,
            decision=decision,
            emergency=self._gate.emergency,
            fault=self._camera.fault or self._fault,
            frame_id=frame.frame_id if frame else None,
            frame_captured_s=frame.captured_s if frame else None,
            prediction=self._prediction,
            sensors=sensors,
            cycle_hz=self._frame_rate_hz(),
            late_cycles=self._late_cycles,
            cycles=self._cycles,
            agreement=sum(self._agreed) / len(self._agreed) if self._agreed else None,
            agreement_frames=len(self._agreed),
            taught=dict(self.school.taught),
            n_nodes=policy.n_nodes,
            max_nodes=policy.max_nodes,
            learner=policy.name,
            moves=policy.moves,
            stops=dict(self._stops),
            link=self._governor.level,
            pilot_frame_age_s=self._governor.age_s,
            learner_times=dict(self._timings),
        )

    def _frame_rate_hz(self) -> float:
        times_s = self._frame_times_s
        if len(times_s) < 2 or times_s[-1] <= times_s[0]:
            return 0.0
        return (len(times_s) - 1) / (times_s[-1] - times_s[0])


class LoopThread:
    """Turns a `ControlLoop` in real time on a thread of its own."""

    def __init__(self, loop: ControlLoop, clock: Clock) -> None:
        self._loop = loop
        self._clock = clock
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to turn; does nothing on a loop that already does."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="control-loop", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop the robot and end the thread; idempotent."""
        if self._thread is not None:
            self._loop.trip(StopReason.PILOT_GONE)
            self._ending.set()
            self._loop.wake.set()
            self._thread.join(timeout=5.0)
            self._thread = None

    def _run(self) -> None:
        loop = self._loop
        while not self._ending.is_set():
            loop.wake.wait(loop.config.longest_wait_s)
            loop.wake.clear()
            loop.tick(self._clock.now_s())
        loop.tick(self._clock.now_s())


__all__ = ["ControlLoop", "LoopConfig", "LoopState", "LoopThread", "Tick"]
