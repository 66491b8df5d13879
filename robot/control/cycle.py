"""One tick: from the newest frame to features, policy, gate and drive; learning comes last.

A `ControlLoop` (`loop.py`) owns a cycle, and puts the requests of other threads into its mailbox.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from robot.camera import Camera
from robot.clock import Clock
from robot.control.camera_timing import CameraTiming
from robot.control.config import LoopConfig
from robot.control.gate import Gate
from robot.control.guarded_body import GuardedBody
from robot.control.link_governor import LinkGovernor
from robot.control.online_learning import OnlineLearning
from robot.control.state import LATE_CYCLE_S, LinkState, SteadyFault, Tick
from robot.driver import BodyButton, Driver, Sensors
from robot.errors import CameraError, DriveError, PluginErrors, RobotError
from robot.policy.policy import Policy
from robot.types import Action, Decision, DrivenBy, Frame, Mode, PilotCommand, StopReason

log = logging.getLogger(__name__)
_T = TypeVar("_T")
_Commands = list[PilotCommand]
STANDS_S = 0.04
"""Upper bound of tick time plus actuator latency, in seconds. The loop stops the robot this much
earlier, so that the wheels have stopped when the pilot's picture expires."""
_RESTS_AFTER_S = 1.0
"""Time after which a robot that stands still without viewers begins to rest, in seconds. This is
enough for a person to reload the page, and for the loop to measure the camera's rate."""
_RESTING_SHARE = 0.9
"""Share of the requested period after which a picture is taken, because cameras can be early."""


class Mailbox:
    """Requests that any thread queues, and that the loop's thread runs between two ticks. The event
    `wake` is set when a request must run now."""

    def __init__(self) -> None:
        self.wake = threading.Event()
        self._requests: deque[tuple[Future[Any] | None, Callable[[], Any]]] = deque()
        self.answers: list[Callable[[], None]] = []

    def put(self, request: Callable[[], _T], *, is_urgent: bool = False) -> Future[_T]:
        """Queue a request to be run on the loop's thread; an urgent request runs before all others.

        All access to the training history must go through this queue. The future is done at the
        end of the tick that ran the request, after all listeners were called with the new state.
        """
        future: Future[_T] = Future()
        add = self._requests.appendleft if is_urgent else self._requests.append
        add((future, request))
        self.wake.set()
        return future

    def note(self, request: Callable[[], None], *, is_news: bool) -> None:
        """Queue a request without an answer; the request must not raise. If `is_news` is False, the
        request does not wake the loop, and runs in the next tick, at most 50 ms later."""
        self._requests.append((None, request))
        if is_news:
            self.wake.set()

    def serve(self) -> None:
        """Run all requests in order, even those queued meanwhile; `answer` delivers the results."""
        while self._requests:
            future, request = self._requests.popleft()
            if future is None:
                request()
                continue
            if not future.set_running_or_notify_cancel():  # the caller cancelled the request
                continue
            try:
                self.answers.append(partial(future.set_result, request()))
            except Exception as error:  # pass the error to the caller; the loop goes on
                self.answers.append(partial(future.set_exception, error))

    def answer(self) -> None:
        """Complete the futures of the requests that were run. Called at the end of the tick."""
        answers, self.answers = self.answers, []
        for answer in answers:
            answer()


class Cycle:
    """Runs the ticks of one robot, on one thread. Other code uses the cycle through the
    `ControlLoop` that owns it."""

    def __init__(
        self,
        driver: Driver,
        camera: Camera,
        policy: Policy,
        clock: Clock,
        config: LoopConfig | None = None,
    ) -> None:
        self.config = config or LoopConfig()
        self.clock = clock
        self.learning = OnlineLearning(policy, clock, driver.declared_moves)
        self.body = GuardedBody(driver, clock)
        self.camera_errors = PluginErrors("camera", camera.name, CameraError)
        self.speed_share = 1.0
        self.error: BaseException | None = None
        self.mailbox = Mailbox()
        self.gate = Gate(self.config.gate, on_stop=self._forget_drive)
        self.link = LinkGovernor(self.config.governor)
        self.timing = CameraTiming(self.config.gate.frame_timeout_s, self.config.camera)
        self.enough_every_s = self.rest_every_s = 0.0
        self.world_s = camera.world_s if camera.world_waits else float
        """Converts a time to the clock of the simulated world, if any. The gate uses this clock."""
        self._driver, self._camera = driver, camera
        self._has_buttons = getattr(driver.take_button, "__func__", None) is not Driver.take_button
        self._source_age_s: float | None = None
        self._commands: list[tuple[PilotCommand, PilotCommand]] = []
        """This tick's commands: each as received, and a copy with times of the world's clock."""
        self._fault: str | None = None
        self._steady = SteadyFault()
        self._last_mode = Mode.TRAIN
        self.listeners: dict[object, tuple[Callable[[Tick], None], bool]] = {}
        self._stirred_s, self._is_resting = clock.now_s(), False
        self.state = Tick(now_s=clock.now_s(), decision=self.gate.stand(), cycles=-1)
        self.state = self._summed_up(self.state)
        camera.listen(self._hear_camera)

    # One tick --------------------------------------------------------------------------------

    def tick(self, now_s: float) -> Tick:
        """Run one tick. An error stops the robot and is shown in `state`; only Ctrl-C is raised."""
        started_s, world_s = self.clock.now_s(), self.world_s(now_s)
        frame, sensors, link = None, Sensors(), self.state.link
        taken, refused = _Commands(), _Commands()
        try:
            self._is_held_up(now_s - self.state.now_s)
            self.mailbox.serve()
            if self._has_buttons:
                self._heed_button()
            link = self.link.state(world_s + STANDS_S, self.timing.state.sight_slack_s)
            taken, refused = self._receive(link, world_s)
            frame = self._look(now_s)
            sensors = self._sense()
            decision, sent = self._drive(*self._decide(link, world_s), started_s)
            if self.gate.mode is not Mode.STOPPED:  # a stopped robot does not learn
                self.learning.learn(
                    taken,
                    is_intervention=self.gate.mode is Mode.AUTONOMOUS,
                    may_learn=link.may_learn,
                )
            self._rest_or_not(now_s)
        except BaseException as error:  # outermost handler: on any error, stop first
            self._break_down(error)
            decision, sent = self.gate.stand(), Action.STOP
        return self._publish(
            Tick(
                now_s=now_s,
                decision=decision,
                sent=sent,
                frame=frame,
                commands=tuple(taken),
                refused=tuple(refused),
                sensors=sensors,
                link=link,
                source_age_s=self._source_age_s,
                fault=self._shown_fault(now_s, may_move=decision.mode is not Mode.STOPPED),
                cycle_s=self.clock.now_s() - started_s,
            )
        )

    def _shown_fault(self, now_s: float, *, may_move: bool) -> str | None:
        """Return the sentence about the present fault, or about one that has just ended."""
        fault = str(self._camera.fault or "") or self._fault  # a plugin may set an exception
        if not fault and not self._camera.world_waits and not self.rest_every_s:
            fault = self.timing.fault
        is_well = fault is None and self._steady.shown is None
        return None if is_well else self._steady.show(fault, now_s, may_move=may_move)

    def _is_held_up(self, seconds: float) -> bool:
        """Stop if the computer was held up for too long, because the last decision is stale."""
        is_harmless = self.gate.mode is Mode.STOPPED or self._camera.world_waits
        if is_harmless or seconds <= self.config.stall_s:
            return False
        why = f"The computer was held up for {seconds:.1f} s. Close other programs and try again."
        self._stop(StopReason.LOOP_FAULT, why)
        return True

    def _heed_button(self) -> None:
        """Obey a button on the robot: any button stops it, and START starts a stopped robot."""
        try:
            button = self.body.ask("take_button")
        except DriveError as error:
            self._stop(StopReason.DRIVE_FAULT, str(error))
            return
        stood = self.state.decision.mode is Mode.STOPPED
        if button is BodyButton.START and stood and self.gate.mode is Mode.STOPPED:
            # ignore the start button if it was pressed before STOP was released
            if not self.state.emergency:
                self.start(self._last_mode)
        elif button:
            self.gate.trip(StopReason.BUTTON)

    def _receive(self, link: LinkState, world_s: float) -> tuple[_Commands, _Commands]:
        """Obey the pilot's commands; return the accepted and the refused commands."""
        commands, self._commands = self._commands, []
        if link.must_stop:
            self.gate.trip(StopReason.LINK_SLOW)
        if self.gate.mode is Mode.STOPPED:
            return [], []
        taken = [one for one, there in commands if self.gate.receive(there, world_s)]
        return taken, [one for one, _ in commands if one not in taken]

    def _look(self, now_s: float) -> Frame | None:
        """Process the camera's newest frame if it is new; return it, or None."""
        last, frame = self.state, self._camera.latest()
        if not self._is_due(frame):
            return None
        delivered_s = max(now_s, self.clock.now_s())
        try:
            self._note_source_age()
            is_new = self.learning.look(
                frame,
                last.decision.action if last.decision.driven_by is DrivenBy.ROBOT else None,
                bumped=bool(last.sensors.bumped),
                takes_points=self._driver.takes_points,
                delivered_s=delivered_s,
            )
        except CameraError as error:
            self._fault = str(error)
            return None
        if frame is None or not is_new:
            return None
        may_move = self.gate.mode is not Mode.STOPPED
        if may_move:
            # clear the error of an earlier picture; a fault that stopped the robot is kept
            self._fault = None
        is_moving = may_move and not self._camera.world_waits
        if not self.rest_every_s:
            self._is_resting = False
            times_s = self.world_s(frame.captured_s), self.world_s(delivered_s)
            self.timing.note(*times_s, is_moving=is_moving)
        return frame

    def _note_source_age(self) -> None:
        try:  # a plugin may define source_age_s as a property or as a string
            age_s = self._camera.source_age_s
            self._source_age_s = None if age_s is None else float(age_s)
        except Exception as error:
            raise self.camera_errors.converted("source_age_s", error) from error

    def _is_due(self, frame: Frame | None) -> bool:
        """Return False for a frame that comes earlier than needed (`need_picture_every`)."""
        last, least_s = self.learning.frame, _RESTING_SHARE * self.rest_every_s
        return not least_s or not frame or not last or frame.captured_s - last.captured_s >= least_s

    def _hear_camera(self) -> None:
        """Wake the loop if a frame is due or there is no frame; runs on the camera's thread."""
        if self._is_due(self._camera.latest()):
            self.mailbox.wake.set()

    def _sense(self) -> Sensors:
        try:
            sensors = self.body.ask("sense")
            if isinstance(sensors, Sensors):
                return sensors
            wrong = TypeError(f"returned {sensors!r} instead of Sensors")
            raise self.body.errors.converted("sense", wrong)
        except DriveError as error:
            self._stop(StopReason.DRIVE_FAULT, str(error))
            return Sensors()

    def _decide(self, link: LinkState, world_s: float) -> tuple[Decision, float]:
        """Choose who drives, and apply the lowest of all speed limits. Return the decision and the
        time at which the order expires."""
        frame, waits = self.learning.frame, self._camera.world_waits
        decision = self.gate.select(
            world_s,
            self.learning.prediction,
            math.inf if frame is None else 0.0 if waits else world_s - frame.captured_s,
            self.timing.state.timeout_s,
            camera_fault=self._camera.fault is not None,
        )
        camera_scale = math.inf if waits else self.timing.state.speed_scale
        scale = min(decision.speed_scale, link.speed_scale, camera_scale)
        is_move = decision.action is not Action.STOP and not waits
        until_s = self.gate.silent_at_s if is_move else math.inf
        return replace(decision, speed_scale=scale * self.speed_share), until_s

    def _drive(
        self, decision: Decision, until_s: float, started_s: float
    ) -> tuple[Decision, Action]:
        """Send the decision to the motors. Return the final decision and the action carried out.

        The process may have been held up during this tick. So a decision is not sent to the body if
        the decision is too old, or if the pilot has become silent meanwhile.
        """
        try:
            if not self._is_held_up(self.clock.now_s() - started_s):
                with self.body.lock:
                    decision = decision if self.body.order(until_s) else self.gate.stand()
                    action, point, scale = decision.action, decision.point, decision.speed_scale
                    sent = self.body.ask("drive", action, point, speed_scale=scale)
                if not self._is_held_up(self.clock.now_s() - started_s):
                    return decision, sent if isinstance(sent, Action) else action
        except DriveError as error:
            self._stop(StopReason.DRIVE_FAULT, str(error))
        return self.gate.stand(), Action.STOP

    def _publish(self, tick: Tick) -> Tick:
        """Pass the tick to all listeners; then complete the requests."""
        try:
            before, self.state = self.state, self._summed_up(tick)
            is_same = tick.decision.mode is before.decision.mode
            if not is_same:
                self.body.ask("show", tick.decision.mode)
            for listener, modes_only in tuple(self.listeners.values()):
                if not (modes_only and is_same):
                    listener(self.state)
        except BaseException as error:  # an error in a listener also stops the robot
            self._break_down(error)
        finally:
            self.mailbox.answer()
        return self.state

    def _summed_up(self, tick: Tick) -> Tick:
        """Return the tick with its events and the state at its end."""
        learning, frame = self.learning, self.learning.frame
        policy = learning.history.policy
        return replace(
            tick,
            cycles=self.state.cycles + 1,
            late_cycles=self.state.late_cycles + (tick.cycle_s > LATE_CYCLE_S),
            prediction=learning.prediction,
            history_events=learning.take_events(),
            cycle_hz=self.timing.rate_hz,
            frame_id=frame.frame_id if frame else None,
            frame_captured_s=frame.captured_s if frame else None,
            is_resting=self._is_resting,
            agreement=learning.agreement.share,
            agreement_frames=learning.agreement.n_examples,
            emergency=self.gate.emergency,
            fault=tick.fault or learning.fault,
            stops=dict(self.gate.stops),
            camera=self.timing.state,
            taught=dict(learning.history.taught),
            n_nodes=policy.learner.n_nodes_,
            max_nodes=policy.max_nodes,
            learner=policy.name,
            moves=policy.moves,
            learner_times=dict(learning.timings),
        )

    def _rest_or_not(self, now_s: float) -> None:
        """Tell the camera whether it may rest."""
        if self.gate.mode is not Mode.STOPPED or not self.enough_every_s:
            self._stirred_s = now_s
        every_s = self.enough_every_s if now_s - self._stirred_s >= _RESTS_AFTER_S else 0.0
        if every_s != self.rest_every_s:
            self.rest_every_s, self._is_resting = every_s, True
            self.timing.pause()  # the gap between two pictures is not the camera's period
            with self.camera_errors.named("rest"):
                self._camera.rest(every_s)

    # Requests of other threads and ways to stop; all run on the loop's thread --------------------

    def note(self, command: PilotCommand) -> None:
        """Keep a command for the next tick. Even a late command is used to measure the link."""
        times = self.learning.times_of(command.frame_id, command.seen_id)
        proven_s = command.received_s if command.proven_s is None else command.proven_s
        received_s = self.world_s(command.received_s)
        there = replace(command, received_s=received_s, proven_s=self.world_s(proven_s))
        if times is not None:
            (captured_s, delivered_s), seen_s = times
            named_s = self.world_s(captured_s), self.world_s(delivered_s)
            seen_s, now_s = self.world_s(seen_s), self.world_s(self.clock.now_s())
            self.link.judge(there, named_s, seen_s, self.timing.state, now_s)
        self._commands.append((command, there))

    def start(self, mode: Mode, proven_s: float | None = None, frame_id: int | None = None) -> bool:
        """Enter a mode; see `ControlLoop.set_mode`."""
        now_s = self.world_s(self.clock.now_s())
        proven_s = None if proven_s is None else self.world_s(proven_s)
        is_taken = self.gate.start(mode, now_s, proven_s)
        if is_taken and mode is not Mode.STOPPED:
            self._forget_drive()
            self._fault, self._last_mode = None, mode
            times = self.learning.times_of(frame_id)
            self.link.note_seen(self.world_s(times[1]) if times else now_s)
        return is_taken

    def _forget_drive(self) -> None:
        """Forget the state of the drive that ends; earlier commands no longer count."""
        self._commands.clear()
        self.learning.reset()

    def _stop(self, reason: StopReason, fault: str) -> None:
        """Stop the motors immediately, and report the fault."""
        self.body.stop_motors()
        self.gate.trip(reason)
        self._fault = fault

    def _break_down(self, error: BaseException) -> None:
        said = error if isinstance(error, RobotError) else f"An internal error occurred: {error}"
        before, fault = self._fault, str(said)
        self._stop(StopReason.LOOP_FAULT, fault)
        self.error = error
        if fault != before:  # log the fault once, not thirty times a second
            log.exception("the loop stopped the robot")
        if isinstance(error, KeyboardInterrupt):  # Ctrl-C ends an experiment on the main thread
            raise error
