"""Ends the moves of bodies without a watchdog: a thread on the robot's computer sends the stop.

A thread on the computer is weaker than a watchdog on the body, because it fails together with the
program, the computer or the link. Use it only for bodies that cannot end a move by themselves.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import ClassVar, TypeVar

from robot.clock import Clock
from robot.devkit.connected_driver import ConnectedDriver, clock_of
from robot.driver import ACTION_TIMEOUT_S
from robot.errors import DriveError
from robot.types import Action, Point

_C = TypeVar("_C")
_T = TypeVar("_T")
_LOG = logging.getLogger(__name__)
GAP_S = 0.002
"""Minimum time between two orders to the body, in seconds. Some bodies drop an order that comes
within 1 ms of the previous order."""
AGAIN_S = 0.015
"""Period at which a stop is repeated, in seconds. A stop is repeated until the body acknowledges
it, or `REPEATS` times for a body that never does."""
REPEATS = 5
"""Number of stops that are sent quickly to a body that does not acknowledge them. Further stops are
sent slowly. If one order in ten is lost, all five stops are lost once in 100,000 times."""
REST_S = 0.2
"""Period of the stops that follow the first `REPEATS`, in seconds. As long as nobody drives, a body
that does not acknowledge stops gets a stop each period. So if the link loses the first stops, a
later stop still stops the body."""
PATIENCE_S = 0.02
"""Time for which a stop waits for a call that is still sending a move, in seconds."""
LONGEST_LEAD_S = 0.15
"""Longest time by which a stop is sent early to allow for its latency, in seconds."""
CLOSES_WITHIN_S = 0.5
"""Longest time for which a disconnect waits for the acknowledgement of its stop, in seconds."""


class MoveEnder:
    """Serialises the calls to one body, and ends its moves from a separate thread.

    A stop is sent `ACTION_TIMEOUT_S` after the last move, minus the latency of stops, and is
    repeated until it succeeds. A stop never waits for a move. If the call that sends a move does
    not return, another thread calls `send_stop` nevertheless. When the move's call has returned,
    `send_stop` is called once more, because the body may have received the move after the stop. A
    move always waits until a stop in progress has ended.

    Args:
        send_stop: Stops the body, or raises an error.
        clock: The clock of the thread and its waits.
        is_acknowledged: True if `send_stop` returns only after the body has received the stop.
            Otherwise stops are repeated while nobody drives.
    """

    def __init__(
        self, send_stop: Callable[[], object], clock: Clock, *, is_acknowledged: bool = False
    ) -> None:
        self._send_stop, self._clock = send_stop, clock
        self._is_acknowledged = is_acknowledged
        self._stopping = clock.lock()
        self._wake, self._is_free = threading.Event(), threading.Event()
        self._is_free.set()
        self._due_s: float | None = clock.now_s()
        self._n_taken = 0
        self._lead_s = 0.0
        self._called_s = clock.now_s() - GAP_S
        self._has_overtaken = self._is_ending = False
        self._thread = clock.start_thread(self._watch, "host watchdog")

    def move(self, send: Callable[[], _T]) -> _T:
        """Send a move, and schedule its stop; return the result of `send`, or raise its error."""
        with self._stopping:
            self._pause()
            self._is_free.clear()
            self._has_overtaken, self._n_taken = False, 0
            self._due_s = self._clock.now_s() + ACTION_TIMEOUT_S - self._lead_s
        self._wake.set()
        try:
            return send()
        finally:
            self._called_s = self._clock.now_s()
            self._is_free.set()
            if self._has_overtaken:  # the body may receive the move after the stop
                self._due_s = self._called_s
                self._wake.set()

    def stop(self) -> None:
        """Send a stop now; raises an error if it fails. The thread repeats the stop until it
        succeeds."""
        self._stop(must=True)

    def end(self) -> bool:
        """Stop the body, and end the thread; return whether the stop succeeded."""
        end_s = self._clock.now_s() + CLOSES_WITHIN_S
        self._n_taken = 0
        with contextlib.suppress(Exception):
            self.stop()
        while not self._is_taken and self._clock.now_s() < end_s:
            self._clock.sleep(AGAIN_S)
        self._is_ending = True
        self._wake.set()
        self._thread.join(CLOSES_WITHIN_S)
        return self._is_taken

    @property
    def _is_taken(self) -> bool:
        return self._n_taken >= (1 if self._is_acknowledged else REPEATS)

    def _stop(self, *, must: bool = False) -> None:
        with self._stopping:
            if not (must or self._is_due):  # a new move has postponed the stop
                return
            self._due_s, self._has_overtaken = self._clock.now_s() + AGAIN_S, True
            is_alone = self._clock.wait(self._is_free, PATIENCE_S)
            self._pause()
            begun_s = self._clock.now_s()
            try:
                self._send_stop()
                self._n_taken += is_alone
            finally:
                self._called_s = self._clock.now_s()
                took_s = self._called_s - begun_s
                self._lead_s = min(max(took_s, 0.9 * self._lead_s), LONGEST_LEAD_S)
                self._due_s = self._called_s + (REST_S if self._is_taken else AGAIN_S)
                if self._is_taken and self._is_acknowledged:
                    self._due_s = None
        self._wake.set()

    @property
    def _is_due(self) -> bool:
        return self._due_s is not None and self._clock.now_s() >= self._due_s

    def _pause(self) -> None:
        self._clock.sleep(max(0.0, self._called_s + GAP_S - self._clock.now_s()))

    def _watch(self) -> None:
        while not self._is_ending:
            due_s = self._due_s
            if due_s is not None and self._clock.now_s() >= due_s:
                with contextlib.suppress(
                    Exception
                ):  # the thread repeats the stop; the next request reports the error
                    self._stop()
                continue
            self._clock.wait(self._wake, None if due_s is None else due_s - self._clock.now_s())
            self._wake.clear()


class HostWatchdog(ConnectedDriver[_C]):
    """Base class of drivers for bodies that cannot end a move by themselves. A thread of this
    `ConnectedDriver` stops the body.

    To stop the body, this class calls the subclass's `_drive` with STOP, sometimes on the
    watchdog's thread, and sometimes before an earlier call of `_drive` has returned.

    Attributes:
        acknowledges: True if `_drive` returns only after the body has received the order. Otherwise
            stops are repeated as long as nobody drives.
        gone_after_s: See `ConnectedDriver`; only for bodies that do not acknowledge orders.
    """

    acknowledges: ClassVar[bool] = False
    __ender: MoveEnder | None = None

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        taken = sorted(
            {"stop", "send_action", "send_point", "connect", "disconnect"} & set(vars(cls))
        )
        if taken:
            raise TypeError(
                f"{cls.__name__}.{taken[0]} replaces a method with which HostWatchdog stops the "
                "body; remove it, and stop the body in `_drive` when the action is Action.STOP"
            )

    def connect(self) -> None:
        super().connect()
        if self.__ender is None:
            send_stop = partial(super().send_action, Action.STOP)
            self.__ender = MoveEnder(send_stop, clock_of(self), is_acknowledged=self.acknowledges)

    def disconnect(self) -> None:
        ender, self.__ender = self.__ender, None
        if ender is not None and not ender.end():
            _LOG.warning(
                "the robot %r did not accept a stop before its connection was closed", self.name
            )
        super().disconnect()

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        self.check_action(action, speed_scale)
        return self.__order(action, partial(super().send_action, action, speed_scale=speed_scale))

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        action = self.move_of(point)
        self.check_action(action, speed_scale)
        return self.__order(action, partial(super().send_point, point, speed_scale=speed_scale))

    def stop(self) -> None:
        if self.__ender is not None:
            with contextlib.suppress(
                DriveError
            ):  # the thread repeats the stop; the next request reports the error
                self.__ender.stop()

    def __order(self, action: Action, send: Callable[[], Action]) -> Action:
        if self.__ender is None:
            return send()  # without a connection this raises NotConnectedError
        if action is not Action.STOP:
            return self.__ender.move(send)
        self.__ender.stop()
        return action


# a stop that is sent early must not end a move that is renewed in time
assert ACTION_TIMEOUT_S - LONGEST_LEAD_S > ACTION_TIMEOUT_S / 2
