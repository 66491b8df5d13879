"""The control loop of one robot: owns the cycle (`cycle.py`), and serves other threads.

`ControlLoop.tick` runs one tick, with time as an argument, and never waits. Experiments call `tick`
directly, as fast as they can; a rig calls it in real time, on a thread. Other threads queue their
requests in a mailbox, so the loop never waits for a network.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from robot.camera import Camera
from robot.clock import Clock
from robot.control.config import LoopConfig
from robot.control.cycle import STANDS_S, Cycle
from robot.control.state import Tick
from robot.driver import Driver
from robot.policy.policy import Policy
from robot.types import Action, Mode, PilotCommand, Point, StopReason

_SHORTEST_WAIT_S = 0.001
_RESTING_WAIT_S = 0.25
"""Longest time between two ticks at rest, in seconds. It is shorter than `ACTION_TIMEOUT_S`, so
that the body's own watchdog does not expire."""


class ControlLoop:
    """One robot's loop. Only one thread calls `tick`; any thread may call the other methods.

    Attributes:
        clock: The clock of the loop and of the other parts of the rig.
        learning: Perception and learning; other threads use it only through `submit`.
        history: The training history of `learning`; other threads use it only through `submit`.
        tick: Runs one tick; see `Cycle.tick`.
        submit: Queues a function to run between two ticks; see `Mailbox.put`.
        wake: Event that is set when a frame, a command or a request needs a tick.
        body: Calls the driver, for all threads; a rig starts its watchdog.
        camera_errors: Converts the errors of the camera's code, for all threads.
    """

    def __init__(
        self,
        driver: Driver,
        camera: Camera,
        policy: Policy,
        clock: Clock,
        config: LoopConfig | None = None,
    ) -> None:
        self._cycle = cycle = Cycle(driver, camera, policy, clock, config)
        self.clock, self.config = clock, cycle.config
        self.learning, self.history = cycle.learning, cycle.learning.history
        self.tick, self.submit, self.wake = cycle.tick, cycle.mailbox.put, cycle.mailbox.wake
        self.body, self.camera_errors = cycle.body, cycle.camera_errors
        self._is_world_waiting = camera.world_waits
        self._asked: tuple[Action | None, Point | None] | None = None
        self._epoch = object()

    @property
    def state(self) -> Tick:
        """The newest tick, for any thread; a frozen value."""
        return self._cycle.state

    @property
    def error(self) -> BaseException | None:
        """The last error of the loop."""
        return self._cycle.error

    @property
    def speed_share(self) -> float:
        """Share of full speed that a person allows, in (0, 1]."""
        return self._cycle.speed_share

    @speed_share.setter
    def speed_share(self, share: float) -> None:
        self._cycle.speed_share = share

    def subscribe(
        self, listener: Callable[[Tick], None], *, modes_only: bool = False
    ) -> Callable[[], None]:
        """Call `listener` after each tick, or with `modes_only` only after a change of mode. The
        listener must be quick. Return a function that ends the calls."""
        key = object()
        self._cycle.listeners[key] = listener, modes_only

        def unsubscribe() -> None:
            self._cycle.listeners.pop(key, None)

        return unsubscribe

    @property
    def mode(self) -> Mode:
        """The mode at this moment. `state` has the mode at the end of the last tick."""
        return self._cycle.gate.mode

    def need_picture_every(self, seconds: float) -> Future[None]:
        """Set how often a picture is needed while the robot is stopped. 0 means that all pictures
        are needed, infinity that none is. While the robot may move, it uses all pictures."""

        def need() -> None:
            self._cycle.enough_every_s = seconds

        return self.submit(need)

    @property
    def wait_s(self) -> float:
        """Maximum time until the next tick, so that the robot stops before the pilot is blind."""
        cycle, longest_s = self._cycle, self.config.longest_wait_s
        if cycle.gate.mode is Mode.STOPPED:
            return _RESTING_WAIT_S if cycle.rest_every_s else longest_s
        stands_s = cycle.world_s(self.clock.now_s()) + STANDS_S
        slack_s = cycle.timing.state.sight_slack_s
        return min(longest_s, max(_SHORTEST_WAIT_S, cycle.link.blind_in_s(stands_s, slack_s)))

    def note_lateness(self, late_s: float) -> None:
        """Record how late this computer is; ignored if the camera's world waits (`world_waits`)."""
        if not self._is_world_waiting:
            is_to_blame = self.state.decision.stop_reason is StopReason.LINK_SLOW
            self._cycle.link.note_lateness(late_s, is_to_blame=is_to_blame)

    def command(self, command: PilotCommand) -> None:
        """Queue a pilot command, and wake the loop if the command changes the held move.

        While the robot may move and the camera is slow, every command wakes the loop. Each tick can
        then send a state with a new nonce, which proves that the next command was sent later.
        """
        held = command.held, command.point
        is_slow = self._cycle.timing.state.period_s > self.config.longest_wait_s
        is_news = held != self._asked or (is_slow and self._cycle.gate.mode is not Mode.STOPPED)
        self._asked = held
        self._cycle.mailbox.note(partial(self._cycle.note, command), is_news=is_news)

    def set_mode(
        self, mode: Mode, *, proven_s: float | None = None, frame_id: int | None = None
    ) -> Future[bool]:
        """Enter a mode; also starts a stopped robot. The future is True if the mode was accepted.

        `proven_s` is the earliest time at which the request can have been made; None means now. The
        loop checks this age when it runs the request, so time in the queue counts. `frame_id` is
        the frame that the pilot sees.
        """
        asked_s = self.clock.now_s() if proven_s is None else proven_s
        epoch, self._asked, start = self._epoch, None, self._cycle.start
        return self.submit(lambda: self._epoch is epoch and start(mode, asked_s, frame_id))

    def empty_command(self) -> Future[None]:
        """Forget the held move and the link of a pilot who leaves, and stop a moving robot."""

        def change_pilot() -> None:
            self._cycle.gate.trip(StopReason.PILOT_GONE)
            self._cycle.link.forget()

        self._asked = None
        return self.submit(change_pilot)

    def trip(self, reason: StopReason) -> Future[None]:
        """Stop and wait for an explicit start."""
        return self.submit(lambda: self._cycle.gate.trip(reason))

    def latch_emergency(self) -> Future[None]:
        """Stop until `release_emergency` is called; runs before all queued requests."""

        def latch() -> None:
            self._cycle.gate.latch_emergency()
            self.body.ask("stop")

        self._epoch = object()  # cancels earlier requests to start or to release
        return self._cycle.mailbox.put(latch, is_urgent=True)

    def release_emergency(self) -> Future[None]:
        """Allow modes to be chosen again; the robot stays stopped."""
        epoch, gate = self._epoch, self._cycle.gate
        return self.submit(lambda: gate.release_emergency() if self._epoch is epoch else None)
