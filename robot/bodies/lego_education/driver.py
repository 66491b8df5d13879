"""The double motor of LEGO Education CS & AI, over Bluetooth LE, by LEGO's library."""

from __future__ import annotations

import contextlib
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.remote.bluetooth import name_trouble
from robot.bodies.remote.same_device import Found, SameDevice
from robot.clock import Clock
from robot.devices.options import Options, option
from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, BodyButton, Sensors
from robot.errors import DriveError, need, told_as
from robot.moves import describe
from robot.types import Action, Point

SEARCH_S = 8.0
GONE_S = 0.4
"""Time without a report after which the motor counts as gone, in s. The motor sends ten reports a
second."""
AGAIN_S = 2.0
_NOTE_EVERY_MS = 100
FULL_PERCENT = 100
"""Acceleration and deceleration, in percent. A motor that brakes gently would stop too late."""
TURN_STEERING = 50
"""Steering of the moves `left` and `right`: the robot turns about the inner wheel. With a steering
of 100 it would spin."""
_ADDRESS = re.compile(
    r"(?:[\dA-F]{2}:){5}[\dA-F]{2}|[\dA-F]{8}(?:-[\dA-F]{4}){3}-[\dA-F]{12}", re.I
)
"""A Bluetooth address, or the UUID that macOS gives programs instead of the address."""
_DIRECTIONS = {
    Action.FORWARD: "MOVEMENT_DIRECTION_FORWARD",
    Action.LEFT: "MOVEMENT_DIRECTION_LEFT",
    Action.RIGHT: "MOVEMENT_DIRECTION_RIGHT",
    Action.BACKWARD: "MOVEMENT_DIRECTION_BACKWARD",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LegoEducationOptions(Options):
    """Options that choose a double motor (a Bluetooth unit with two motors), and its speed."""

    hub: str = option(
        "", "part of the double motor's name, or its address; needed if several are in range"
    )
    straight_percent: int = option(50, "speed straight ahead, in percent", range=(1, 100))
    turn_percent: int = option(25, "speed of turns, in percent", range=(1, 100))


class LegoEducationDriver(ConnectedDriver[Any]):
    """Drives a double motor, which times each move itself (`movement_move_for_time`)."""

    name: ClassVar[str] = "lego-education"
    default_camera: ClassVar[str] = "phone"
    options_type: ClassVar[type[Any]] = LegoEducationOptions
    is_remote: ClassVar[bool] = True
    declared_moves = describe(_DIRECTIONS)

    def __init__(
        self, options: LegoEducationOptions, clock: Clock | None = None, library: Any = None
    ) -> None:
        super().__init__(options, clock)
        self._library = library
        self._found: Any = None
        self._same = SameDevice("double motor")
        self._heard_s = self._tried_s = 0.0
        self._was_pressed = False

    def _open(self) -> Any:
        if self._library is None:
            self._library = need("legoeducation", "the robot 'lego-education'", "lego-education")
        motor = self._library.DoubleMotor()
        searched = self._search(motor)
        found = {_as_found(one): one for one in searched}
        if not found:
            name = f" with {self.options.hub!r} in its name" if self.options.hub else ""
            raise DriveError(
                f"no double motor{name} is in range; is it switched on, and not connected "
                "elsewhere?"
            )
        nameless = [one for one in found if one.address == one.name]
        # Older versions of the library give no addresses, so motors of the same name look alike.
        if nameless and len(found) < len(searched):
            raise DriveError(
                f"several double motors in range are called {nameless[0]}; give each a name of its "
                "own, or install a newer version of LEGO's library, which shows addresses"
            )
        with told_as(DriveError, "it is unclear which double motor to drive", ConnectionError):
            chosen = self._same.pick(found)
        if chosen is None:
            raise DriveError(f"the double motor {self._same.name_absent(found)}")
        motor.set_notification_callback(self._note)
        self._same.chosen, self._found = chosen, found[chosen]
        return motor

    def _search(self, motor: Any) -> list[Any]:
        """Return the double motors in range whose name or address matches.

        If a search fails, the library logs a traceback and returns None.
        """
        wanted = self.options.hub
        name = None if _ADDRESS.fullmatch(wanted) else wanted or None
        try:
            with _logged_errors(getattr(motor, "logger", None)) as errors:
                found = motor.search(timeout=SEARCH_S, device_name=name)
            if errors:
                raise errors[0]
        except Exception as error:
            why = name_trouble(error) or f"{error}; is Bluetooth on?"
            raise DriveError(f"cannot search for double motors: {why}") from error
        return [one for one in found or () if name or _as_found(one).is_called(wanted)]

    @property
    def device(self) -> str:
        return str(self._same.chosen or "")

    def _begin(self) -> None:
        self._reach(self._connected())
        self.stop()

    def _reach(self, motor: Any) -> None:
        self._tried_s = self._clock.now_s()
        # The library's message names the remedy, for example an update of the firmware.
        with told_as(DriveError, "the double motor cannot be used", Exception):
            motor.connect(self._found, device_notification_delay=_NOTE_EVERY_MS)
        if not motor.connected:
            raise DriveError("cannot connect to the double motor; switch it off and on again")
        self._set_up(motor)
        self._heard_s = self._clock.now_s()

    def _set_up(self, motor: Any) -> None:
        """Set every value that a motor may retain from another program, for example its braking."""
        with told_as(DriveError, "the double motor did not accept its settings", Exception):
            motor.movement_set_end_state(self._library.MOTOR_END_STATE_BRAKE)
            motor.movement_set_acceleration(FULL_PERCENT, FULL_PERCENT)
            motor.movement_set_turn_steering(TURN_STEERING)

    def _close(self, connection: Any) -> None:
        with contextlib.suppress(Exception):
            connection.disconnect()

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        connection = self._connected()
        self._check_heard(connection)
        if action is Action.STOP:
            self.stop()
            return
        is_straight = action in (Action.FORWARD, Action.BACKWARD)
        percent = self.options.straight_percent if is_straight else self.options.turn_percent
        with told_as(DriveError, "the double motor did not accept a command", Exception):
            connection.movement_move_for_time(
                round(1000 * ACTION_TIMEOUT_S),
                direction=getattr(self._library, _DIRECTIONS[action]),
                speed=max(1, round(percent * speed_scale)),
                blocking=False,
            )

    def sense(self) -> Sensors:
        """Return the double motor's last report. If the motor is lost, search for it from time to
        time."""
        motor = self._connection
        if motor is None:
            return Sensors()
        if not motor.connected and self._clock.now_s() - self._tried_s > AGAIN_S:
            self._reach(motor)
        self._check_heard(motor)
        level = motor.info_device.batteryLevel
        return Sensors(battery_share=min(max(level / 100, 0.0), 1.0))

    def stop(self) -> None:
        """Stop the motors; a lost double motor stops by itself."""
        motor = self._connection
        if motor is not None and motor.connected:
            with contextlib.suppress(Exception):
                motor.movement_stop(blocking=False)

    def take_button(self) -> BodyButton | None:
        """Return "stop" if the double motor's button was pressed."""
        motor = self._connection
        if motor is None:
            return None
        is_pressed = motor.button.state == self._library.BUTTON_STATE_PRESSED
        is_new, self._was_pressed = is_pressed and not self._was_pressed, is_pressed
        return BodyButton.STOP if is_new else None

    def _note(self, notification: Any) -> None:
        """Note a report, on the library's thread."""
        self._heard_s = self._clock.now_s()

    def _check_heard(self, motor: Any) -> None:
        silent_s = self._clock.now_s() - self._heard_s
        if not motor.connected or silent_s > GONE_S:
            raise DriveError(
                f"the double motor has sent nothing for {silent_s:.1f} s; is it switched on and in "
                "range?"
            )


def _as_found(device: Any) -> Found:
    """Return a device's name and address; older versions of the library give no address."""
    name = str(getattr(device, "name", "") or "")
    return Found(name, str(getattr(device, "address", "") or name))


@contextmanager
def _logged_errors(logger: logging.Logger | None) -> Iterator[list[BaseException]]:
    """Collect the errors that a library logs with a traceback, and keep them off the terminal."""
    errors: list[BaseException] = []

    def take(record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            errors.append(error)
        return error is None

    if logger is None:
        yield errors
        return
    logger.addFilter(take)
    try:
        yield errors
    finally:
        logger.removeFilter(take)
