"""The control loop: newest frame, features, policy, gate, drive; and only then learning.

`ControlLoop.tick` runs one tick, with time as an argument, and never waits. Experiments call it
directly, as fast as they can; `robot.control.thread` calls it in real time. Other threads queue
their requests in a mailbox, so the loop never waits for a network.

One file because the order of the steps in a tick is what keeps the robot safe: whoever changes one
must see the others.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import TypeVar

from robot.camera import Camera
from robot.clock import Clock
from robot.control.camera_timing import CameraTiming, CameraTimingConfig
from robot.control.dead_reckoning import DeadReckoning
from robot.control.gate import Gate, GateConfig
from robot.control.link_governor import LinkGovernor, LinkGovernorConfig, age_of_link_s
from robot.control.mailbox import Mailbox
from robot.control.online_learning import OnlineLearning
from robot.control.state import LoopState, StatePublisher, Tick
from robot.driver import BodyButton, Driver
from robot.errors import CameraError, DriveError
from robot.learner.base import Vector
from robot.policy.history import TrainingHistory
from robot.policy.policy import Policy
from robot.types import (
    Action,
    Decision,
    DrivenBy,
    Frame,
    Mode,
    PilotCommand,
    Prediction,
    Sensors,
    StopReason,
)

log = logging.getLogger(__name__)
_T = TypeVar("_T")
_STANDS_S = 0.04
"""A tick and the body take at most so long: then the wheels stand when the pilot is blind."""
_SHORTEST_WAIT_S = 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopConfig:
    """What the loop does, and how patient it is."""

    gate: GateConfig = field(default_factory=GateConfig)
    governor: LinkGovernorConfig = field(default_factory=LinkGovernorConfig)
    camera: CameraTimingConfig = field(default_factory=CameraTimingConfig)
    longest_wait_s: float = 0.05
    """Longest time between two ticks, even when the camera sends nothing."""
    late_cycle_s: float = 0.1
    """A tick that takes longer counts as late."""
    stall_s: float = 0.3
    """After a longer gap between two ticks the robot stops: commands received meanwhile are out of
    date (the computer slept, or the process was held up)."""


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
        wake: threading.Event | None = None,
    ) -> None:
        self.config = config or LoopConfig()
        self._driver = driver
        self._camera = camera
        self._clock = clock
        self._gate = Gate(self.config.gate)
        self._governor = LinkGovernor(self.config.governor)
        self._camera_timing = CameraTiming(self.config.gate.frame_timeout_s, self.config.camera)
        self._online_learning = OnlineLearning(policy, clock, driver.declared_moves)
        self._dead_reckoning = DeadReckoning(driver)
        self._mailbox = Mailbox(wake)
        self._board = StatePublisher(
            self._online_learning, self._governor, self._camera_timing, self.config.late_cycle_s
        )
        self._last_tick_s: float | None = None
        self._fault: str | None = None
        self._decision = self._idle_decision()
        self._sensors = Sensors()
        self._refused: list[PilotCommand] = []
        self._last_mode = Mode.TRAIN
        self._shown_mode = Mode.STOPPED
        self._epoch = object()
        self.speed_share = 1.0
        self._board.show(clock.now_s(), self._decision, self._sensors)
        camera.listen(self.wake.set)

    # What others ask of the loop -------------------------------------------------------------

    @property
    def wake(self) -> threading.Event:
        """Set when there is a reason for a tick: a frame, a command, a request."""
        return self._mailbox.wake

    @property
    def wait_s(self) -> float:
        """The longest time until the next tick: a pilot who grows blind is not waited for."""
        longest_s = self.config.longest_wait_s
        if self._gate.mode is Mode.STOPPED:
            return longest_s
        return min(longest_s, max(_SHORTEST_WAIT_S, self._blind_in_s(self._clock.now_s())))

    def note_lateness(self, late_s: float) -> None:
        """Take note of how late this computer did what was due; a world that waits minds none."""
        if not self._camera.world_waits:
            is_to_blame = self.state.decision.stop_reason is StopReason.LINK_SLOW
            self._governor.note_lateness(late_s, is_to_blame=is_to_blame)

    @property
    def clock(self) -> Clock:
        """The clock of the loop, and of whatever runs beside it."""
        return self._clock

    @property
    def history(self) -> TrainingHistory:
        """The training history of the policy; use it only through `submit`."""
        return self._online_learning.history

    @property
    def learner_failure(self) -> str | None:
        """How the learner in use ever failed; None if it did not."""
        return self._online_learning.failure

    @property
    def newest(self) -> tuple[Vector, Prediction] | None:
        """The newest frame's vector and prediction; use it only through `submit`."""
        return self._online_learning.newest

    @property
    def mode(self) -> Mode:
        """The mode at this moment, for requests: `state` has that of the last complete tick."""
        return self._gate.mode

    @property
    def state(self) -> LoopState:
        """The newest state; a frozen value that never changes under the reader."""
        return self._board.state

    def command(self, command: PilotCommand) -> None:
        """Queue a pilot command and wake the loop."""
        self._mailbox.put_command(command)

    def set_mode(
        self, mode: Mode, *, proven_s: float | None = None, frame_id: int | None = None
    ) -> Future[bool]:
        """Choose a mode: the explicit start after any stop. The future is True if it was taken.

        Args:
            mode: The mode; STOPPED is always accepted.
            proven_s: A time before which the request cannot have been made; None: now. The loop
                checks it when it runs the request, so time in the queue counts.
            frame_id: The frame that the pilot sees; None: not known.
        """
        if proven_s is None:
            proven_s = self._clock.now_s()
        epoch = self._epoch
        return self.submit(lambda: self._is_latest(epoch) and self._start(mode, proven_s, frame_id))

    def empty_command(self) -> Future[None]:
        """Forget what is held: the pilot joined, left or lost the wheel. Stops a moving robot."""
        return self.submit(self._change_pilot)

    def trip(self, reason: StopReason) -> Future[None]:
        """Stop and wait for an explicit start."""
        return self.submit(lambda: self._trip(reason))

    def latch_emergency(self) -> Future[None]:
        """Stop until `release_emergency`; it is run before all queued requests."""
        self._epoch = object()
        return self._mailbox.put_request(self._latch_emergency, is_urgent=True)

    def release_emergency(self) -> Future[None]:
        """Allow modes to be chosen again; the robot stays stopped."""
        epoch = self._epoch

        def release() -> None:
            if self._is_latest(epoch):
                self._gate.release_emergency()

        return self.submit(release)

    def submit(self, request: Callable[[], _T]) -> Future[_T]:
        """Queue `request`, to be run at the beginning of a tick on the loop's own thread.

        Everything that reads or changes the training history is submitted here: undo, edits,
        saving, replacing. The future is done at the end of that tick, when `state` is up to date.
        """
        return self._mailbox.put_request(request)

    def subscribe(self, listener: Callable[[Tick], None]) -> Callable[[], None]:
        """Call `listener` after each tick, on the loop's thread; it must return at once.

        Returns:
            A function that ends the subscription.
        """
        return self._board.subscribe(listener)

    # One tick --------------------------------------------------------------------------------

    def tick(self, now_s: float) -> Tick:
        """Run one tick. Never raises: an error stops the robot and is reported in `state`."""
        started_s = self._clock.now_s()
        try:
            return self._run_tick(now_s, started_s)
        except Exception as error:  # top of the loop: whatever it is, stop first
            self._driver.stop()
            self._trip(StopReason.LOOP_FAULT)
            fault = f"Something went wrong inside: {error}"
            if fault != self._fault:  # once, not thirty times a second
                log.exception("the loop stopped the robot")
            self._fault = fault
            return self._finish(now_s, started_s, None, [], self._idle_decision(), Action.STOP)
        finally:
            self._mailbox.answer_requests()

    def _run_tick(self, now_s: float, started_s: float) -> Tick:
        self._check_stall(now_s)
        self._mailbox.serve_requests()
        self._heed_button()
        commands = self._receive(now_s)
        frame = self._look(now_s)
        sensors = self._sense(now_s)
        decision = self._decide(now_s)
        sent = self._drive(decision, started_s)
        if sent is None:
            decision, sent = self._idle_decision(), Action.STOP
        if self._gate.mode is not Mode.STOPPED:  # a stopped robot does not learn
            self._online_learning.learn(
                commands,
                is_intervention=self._gate.mode is Mode.AUTONOMOUS,
                may_learn=self._governor.may_learn,
            )
        return self._finish(now_s, started_s, frame, commands, decision, sent, sensors)

    def _check_stall(self, now_s: float) -> None:
        before_s, self._last_tick_s = self._last_tick_s, now_s
        if before_s is not None:
            self._trip_if_held_up(now_s - before_s)

    def _trip_if_held_up(self, seconds: float) -> bool:
        is_harmless = self._gate.mode is Mode.STOPPED or self._camera.world_waits
        if is_harmless or seconds <= self.config.stall_s:
            return False
        self._trip(StopReason.LOOP_FAULT)
        self._fault = f"The robot's computer was held up for {seconds:.1f} s."
        return True

    def _heed_button(self) -> None:
        """Obey a button on the robot itself: any stops it, the start button starts it again."""
        button = self._driver.take_button()
        if button is BodyButton.START and self._gate.mode is Mode.STOPPED:
            self._start(self._last_mode)
        elif button is not None:
            self._trip(StopReason.BUTTON)

    def _receive(self, now_s: float) -> list[PilotCommand]:
        commands = self._mailbox.take_commands()
        for command in commands:
            self._judge_link(command, now_s)
        if self._gate.mode is Mode.STOPPED:
            return []
        if self._governor.must_stop or self._blind_in_s(now_s) < 0:
            self._trip(StopReason.LINK_SLOW)
            return []
        taken: list[PilotCommand] = []
        for command in commands:
            is_taken = self._gate.receive(command, now_s)
            (taken if is_taken else self._refused).append(command)
        return taken

    def _blind_in_s(self, now_s: float) -> float:
        return self._governor.blind_in_s(now_s + _STANDS_S, self._camera_timing.sight_slack_s)

    def _judge_link(self, command: PilotCommand, now_s: float) -> None:
        """Pass the age of the picture that the pilot acts upon to the link governor."""
        if command.frame_id is None:
            return
        times = self._online_learning.times_of(command.frame_id)
        if times is None:
            return
        captured_s, delivered_s = times
        seen_id = command.frame_id if command.seen_id is None else command.seen_id
        seen = self._online_learning.times_of(min(seen_id, command.frame_id))
        self._governor.note_seen((seen or times)[1])
        reported_s = command.frame_age_s
        if reported_s is not None:
            reported_s -= delivered_s - captured_s
        # If the page reports how long the phone had the picture, no period has to be allowed for.
        slack_s = self._camera_timing.slack_s if command.phone_s is None else 0.0
        age_s = age_of_link_s(command.received_s - delivered_s, reported_s, command.phone_s)
        self._governor.note_age(age_s, now_s, slack_s)

    def _look(self, now_s: float) -> Frame | None:
        """Process the newest frame; return it if it is new."""
        delivered_s = max(now_s, self._clock.now_s())
        try:
            is_new = self._online_learning.look(
                self._camera.latest(),
                self._under_way(),
                bumped=bool(self._sensors.bumped),
                delivered_s=delivered_s,
            )
        except CameraError as error:
            self._fault = str(error)
            return None
        frame = self._online_learning.frame
        if frame is None or not is_new:
            return None
        self._camera_timing.source_age_s = self._camera.source_age_s
        is_moving = self._gate.mode is not Mode.STOPPED and not self._camera.world_waits
        self._camera_timing.note(frame.captured_s, delivered_s, is_moving=is_moving)
        return frame

    def _under_way(self) -> Action | None:
        """Return the move that the policy is making; None if the policy does not drive."""
        is_robots = self._decision.driven_by is DrivenBy.ROBOT
        return self._decision.action if is_robots else None

    def _sense(self, now_s: float) -> Sensors | None:
        try:
            return self._dead_reckoning.locate(self._driver.sense(), now_s)
        except DriveError as error:
            self._drive_failed(error)
            return None

    def _decide(self, now_s: float) -> Decision:
        was_moving = self._gate.mode is not Mode.STOPPED
        frame = self._online_learning.frame
        waits = self._camera.world_waits
        decision = self._gate.select(
            now_s,
            self._online_learning.prediction,
            None if frame is None else now_s if waits else frame.captured_s,
            camera_fault=self._camera.fault is not None,
            frame_timeout_s=self._camera_timing.timeout_s,
        )
        if was_moving and decision.mode is Mode.STOPPED and decision.stop_reason is not None:
            self._note_stop(decision.stop_reason)
            self._reset()
        camera_scale = 1.0 if waits else self._camera_timing.speed_scale
        scale = min(decision.speed_scale, self._governor.speed_scale, camera_scale)
        scale *= self.speed_share
        return decision if scale == decision.speed_scale else replace(decision, speed_scale=scale)

    def _drive(self, decision: Decision, started_s: float) -> Action | None:
        """Send the decision to the motors; on failure stop the motors and return None.

        The process may be held up within a tick, too: an outdated decision is not sent.
        """
        if self._is_too_late(started_s):
            return None
        try:
            scale, point = decision.speed_scale, decision.point
            if point is not None and self._driver.takes_points:
                sent = self._driver.send_point(point, speed_scale=scale)
                self._dead_reckoning.told(sent, scale, point)
            else:
                sent = self._driver.send_action(decision.action, speed_scale=scale)
                self._dead_reckoning.told(sent, scale)
        except DriveError as error:
            self._drive_failed(error)
            return None
        return None if self._is_too_late(started_s) else sent

    def _is_too_late(self, started_s: float) -> bool:
        is_held_up = self._trip_if_held_up(self._clock.now_s() - started_s)
        if is_held_up:
            self._driver.stop()
        return is_held_up

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
        refused, self._refused = tuple(self._refused), []
        self._decision, self._sensors = decision, sensors or Sensors()
        tick = Tick(
            now_s=now_s,
            frame=frame,
            commands=tuple(commands),
            refused=refused,
            decision=decision,
            sent=sent,
            prediction=self._online_learning.prediction,
            sensors=self._sensors,
            history_events=self._online_learning.take_events(),
            cycle_s=self._clock.now_s() - started_s,
        )
        if decision.mode is not self._shown_mode:
            self._shown_mode = decision.mode
            self._driver.show(decision.mode)
        self._board.publish(
            tick,
            emergency=self._gate.emergency,
            fault=self._camera.fault or self._fault or self._online_learning.fault,
        )
        return tick

    # Requests, run on the loop's thread ----------------------------------------------------

    def _is_latest(self, epoch: object) -> bool:
        """False if an emergency stop, which begins an epoch, was requested after this request."""
        return self._epoch is epoch

    def _start(
        self, mode: Mode, proven_s: float | None = None, frame_id: int | None = None
    ) -> bool:
        if mode is Mode.STOPPED:
            self._trip(StopReason.PILOT_ASKED)
            return True
        self._reset()
        now_s = self._clock.now_s()
        was_moving = self._gate.mode is not Mode.STOPPED
        is_taken = self._gate.start(mode, now_s, proven_s)
        if is_taken:
            self._fault = None
            self._last_mode = mode
            times = self._online_learning.times_of(frame_id) if frame_id is not None else None
            self._governor.note_seen(times[1] if times else now_s)
        elif was_moving and self._gate.stop_reason is not None:
            self._note_stop(self._gate.stop_reason)
        return is_taken

    def _change_pilot(self) -> None:
        self._trip(StopReason.PILOT_GONE)
        self._governor.forget()

    def _trip(self, reason: StopReason) -> None:
        if self._gate.mode is not Mode.STOPPED:
            self._note_stop(reason)
        self._gate.trip(reason)
        self._reset()

    def _latch_emergency(self) -> None:
        self._trip(StopReason.EMERGENCY)
        self._gate.latch_emergency()
        self._driver.stop()

    def _reset(self) -> None:
        """Forget whatever belongs to the drive that ends here.

        Commands that are still queued do not count in the next drive, but their delay still counts
        as a measurement of the link.
        """
        now_s = self._clock.now_s()
        for command in self._mailbox.take_commands():
            self._judge_link(command, now_s)
        self._online_learning.reset()

    def _note_stop(self, reason: StopReason) -> None:
        self._board.count_stop(reason)
        log.info("stop reason=%s", reason.value)

    def _drive_failed(self, error: DriveError) -> None:
        self._fault = str(error)
        self._trip(StopReason.DRIVE_FAULT)
        self._driver.stop()

    def _idle_decision(self) -> Decision:
        return Decision(
            action=Action.STOP,
            driven_by=DrivenBy.NOBODY,
            mode=Mode.STOPPED,
            stop_reason=self._gate.stop_reason,
        )
