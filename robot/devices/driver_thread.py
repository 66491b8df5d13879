"""Runs a driver on a separate thread, for bodies that answer over a network.

The control loop must never wait for a body: with 45 ms per request the loop would run at 10 Hz,
drive at half speed and learn less than half of the examples. So the loop puts its newest action
into a slot, and a thread sends this action when the body is ready. Older actions are never sent.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

from robot.clock import Clock, Worker
from robot.driver import ACTION_TIMEOUT_S, BodyButton, Correction, Driver, Sensors
from robot.errors import DriveError, NotConnectedError
from robot.types import Action, Mode, Point

SENSE_EVERY_S = 0.1
"""Period at which the sensors are read, even if actions wait to be sent, in seconds."""
STALE_S = 0.25
"""Waiting time after which an action is outdated and the body is stopped instead, in seconds."""
SILENT_S = 0.5
"""Time after which an unfinished request is a fault, in seconds. By then the body's move has
ended."""


@dataclass(frozen=True, slots=True)
class _Order:
    action: Action
    speed_scale: float
    queued_s: float
    point: Point | None = None


def _of_body(name: str) -> Any:
    """Return a property that reads this attribute of the wrapped body."""
    return property(attrgetter(f"driver.{name}"))


class DriverThread(Driver):
    """Wraps a driver that declares `is_remote`, so that the loop's calls return immediately.

    A fault of the body is raised by the next call, and by all further calls until a request
    succeeds. The thread calls `step` repeatedly, and each call does one request.
    """

    def __init__(self, driver: Driver, clock: Clock) -> None:
        self.driver = driver
        self._clock = clock
        self._lock = threading.Lock()
        self._due = threading.Event()
        self._thread: Worker | None = None
        self._ending = False
        self._order: _Order | None = None
        self._must_stop = False
        self._mode: Mode | None = None
        self._correction: Correction | None = None
        self._sensors = Sensors()
        self._sensed_s = -SENSE_EVERY_S
        self._button: BodyButton | None = None
        self._faults: dict[str, BaseException] = {}
        self._driven = Action.STOP
        self._request_s: float | None = None

    name = _of_body("name")
    device = _of_body("device")
    default_camera = _of_body("default_camera")
    options_type = _of_body("options_type")
    declared_moves = _of_body("declared_moves")
    moves = _of_body("moves")
    takes_points = _of_body("takes_points")
    correction = _of_body("correction")
    turns_motors = _of_body("turns_motors")
    is_connected = _of_body("is_connected")
    takes_advice = _of_body("takes_advice")
    advise = _of_body("advise")
    announce = _of_body("announce")

    def connect(self) -> None:
        self.driver.connect()
        if self._thread is None:
            self._ending = False
            self._thread = self._clock.start_thread(self._run, "driver")

    def disconnect(self) -> None:
        """End the thread after the request in progress, stop the body and disconnect it."""
        self._ending = True
        self._due.set()
        if self._thread is not None:
            self._thread.join(timeout=4 * SILENT_S)
            self._thread = None
        with self._lock:
            self._order, self._must_stop, self._request_s = None, False, None
            self._sensors, self._button, self._mode = Sensors(), None, None
            self._faults.clear()
        self.driver.disconnect()

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        """Queue the action in place of an action that is still waiting. See `Driver`."""
        return self.drive(action, speed_scale=speed_scale)

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        """Queue steering and throttle in place of an order that is still waiting."""
        return self.drive(self.driver.move_of(point), point, speed_scale=speed_scale)

    def drive(
        self, action: Action, point: Point | None = None, *, speed_scale: float = 1.0
    ) -> Action:
        self.driver.check_action(action, speed_scale)
        if not self.driver.is_connected:
            raise NotConnectedError(f"the robot {self.name!r} is not connected")
        with self._lock:
            self._order = _Order(action, speed_scale, self._clock.now_s(), point)
        self._due.set()
        self._raise_fault("drive")
        return action

    def sense(self) -> Sensors:
        """Return the sensors' latest readings, which are about a tenth of a second old."""
        self._raise_fault("sense")
        return self._sensors

    def stop(self) -> None:
        """Stop the body before any other request; waiting actions are dropped."""
        with self._lock:
            self._order, self._must_stop = None, True
        self._due.set()
        if self._thread is None:
            self.driver.stop()

    def take_button(self) -> BodyButton | None:
        """Return the latest press of a button on the body, or None."""
        with self._lock:
            button, self._button = self._button, None
        return button

    def show(self, mode: Mode) -> None:
        with self._lock:
            self._mode = mode
        self._due.set()

    def correct(self, correction: Correction) -> None:
        """Apply a correction before any further action; waiting actions are dropped.

        A body may have to connect again for this. If it fails, the next `drive` raises the error.
        """
        if self._thread is None:
            self.driver.correct(correction)
            return
        with self._lock:
            self._order, self._must_stop, self._correction = None, True, correction
        self._due.set()

    # On the thread -----------------------------------------------------------------------------

    def step(self) -> bool:
        """Do the most urgent request: stop, drive, sense or show. Return False if there is none."""
        now_s = self._clock.now_s()
        with self._lock:
            request = self._choose(now_s)
            self._request_s = None if request is None else now_s
        if request is None:
            return False
        kind, do = request
        try:
            do()
            self._faults.pop(kind, None)
        except BaseException as error:  # the loop's next call raises this error
            self._faults[kind] = error
        finally:
            self._request_s = None
        return True

    def _choose(self, now_s: float) -> tuple[str, Callable[[], None]] | None:
        """Remove and return the most urgent request: stop, then sense or drive, then show.

        STOP always comes before a reading of the sensors. So does a new action, unless a reading is
        late by more than `SENSE_EVERY_S`. A repeated action waits for a reading that is due.
        """
        order, since_s = self._order, now_s - self._sensed_s
        is_new = order is not None and order.action is not self._driven
        is_stop = order is not None and order.action is Action.STOP
        if self._must_stop:
            self._must_stop = False
            return "drive", self._stop
        if self._correction is not None:
            correction, self._correction = self._correction, None
            self._order = None
            return "drive", partial(self.driver.correct, correction)
        if since_s >= SENSE_EVERY_S and not (is_new and (is_stop or since_s < 2 * SENSE_EVERY_S)):
            return "sense", partial(self._sense, now_s)
        if order is not None:
            self._order = None
            return "drive", partial(self._drive, order, now_s)
        if self._mode is not None:
            mode, self._mode = self._mode, None
            return "show", partial(self.driver.show, mode)
        return None

    def _stop(self) -> None:
        self._driven = Action.STOP
        self.driver.stop()

    def _drive(self, order: _Order, now_s: float) -> None:
        self._driven = order.action
        if now_s - order.queued_s > STALE_S:
            self.driver.stop()
        else:
            self.driver.drive(order.action, order.point, speed_scale=order.speed_scale)

    def _sense(self, now_s: float) -> None:
        self._sensed_s = now_s
        self._sensors = self.driver.sense()
        button = self.driver.take_button()
        # Ignore a start button that was pressed while the body did not answer.
        if button is BodyButton.STOP or (button and "sense" not in self._faults):
            self._button = button

    def _run(self) -> None:
        while not self._ending:
            if not self.step():
                self._clock.wait(self._due, SENSE_EVERY_S)
                self._due.clear()
        with contextlib.suppress(BaseException):
            self.driver.stop()

    def _raise_fault(self, kind: str) -> None:
        request_s = self._request_s
        if request_s is not None and self._clock.now_s() - request_s > SILENT_S:
            raise DriveError(
                f"the robot {self.name!r} does not answer; is it switched on and in range?"
            )
        fault = self._faults.get(kind) or self._faults.pop("show", None)
        if fault is not None:
            raise fault


assert STALE_S < ACTION_TIMEOUT_S < SILENT_S
