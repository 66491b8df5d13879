"""Drives a rover with ArduPilot or PX4 over MAVLink, by MANUAL_CONTROL messages.

The autopilot does not acknowledge these messages. The driver sets the autopilot's timeout of the
pilot's input to the duration of a move; its thread repeats the stop while nobody drives.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

os.environ.setdefault("MAVLINK20", "1")  # pymavlink reads this when it is imported
from pymavlink import mavutil

from robot.devkit.host_watchdog import HostWatchdog
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.errors import DriveError
from robot.moves import CLASSIC, Move, point_of
from robot.types import Action, Point

MAV = mavutil.mavlink
NO_AUTOPILOT = MAV.MAV_AUTOPILOT_INVALID
"""The autopilot field in the heartbeats of ground stations, such as this program."""
REPORT_EVERY_S = 0.1
"""The requested period of SYS_STATUS, in seconds, because heartbeats come only once a second."""
HEARTBEAT_EVERY_S = 0.5
ANSWER_S = 0.4
"""How long we wait for the answer to a command, in seconds; a command is sent up to three times."""
AUTOPILOTS = {
    MAV.MAV_AUTOPILOT_ARDUPILOTMEGA: ("ArduPilot", "RC_OVERRIDE_TIME"),
    MAV.MAV_AUTOPILOT_PX4: ("PX4", "COM_RC_LOSS_T"),
}
"""Each autopilot's name, and the parameter that sets the timeout of the pilot's input."""


@dataclass(frozen=True, kw_only=True)
class RoverOptions:
    rover_address: str = field(
        default="udpin:0.0.0.0:14550", metadata={"help": "as pymavlink writes it, or /dev/ttyACM0"}
    )
    rover_throttle: float = field(
        default=0.3, metadata={"help": "maximum share of the full throttle", "range": (0.05, 1.0)}
    )
    rover_arm: bool = field(default=False, metadata={"help": "arm the rover at the start"})


class RoverDriver(HostWatchdog[Any]):
    name = "rover"
    default_camera = "phone"
    options_type = RoverOptions
    is_remote = True
    takes_points = True
    gone_after_s = 0.4
    declared_moves: tuple[Move, ...] = tuple(
        CLASSIC[move] for move in (Action.FORWARD, Action.LEFT, Action.RIGHT, Action.BACKWARD)
    )

    def __init__(self, options: RoverOptions, clock: Any = None) -> None:
        super().__init__(options, clock)
        self._sending = threading.Lock()  # pymavlink numbers messages, and two threads send them
        self._beaten_s = float("-inf")
        self._autopilot = ""
        self._is_armed = self._has_armed = self._ends_itself = False
        self._battery: float | None = None
        self._said = ""

    @property
    def device(self) -> str:
        """The page's line about the robot: its autopilot, and whether the rover is armed."""
        words = [self._autopilot, "armed" if self._is_armed else "disarmed"]
        return ", ".join(words if self._ends_itself else [*words, "without a timeout of its own"])

    def _open(self) -> Any:
        return mavutil.mavlink_connection(self.options.rover_address, source_system=255)

    def _begin(self) -> None:
        where, line = self.options.rover_address, self._connected()
        if self._ask(self._beat, "HEARTBEAT", lambda m: m.autopilot != NO_AUTOPILOT) is None:
            raise DriveError(f"no autopilot sends heartbeats to {where}; is it on and connected?")
        kind = line.field("HEARTBEAT", "autopilot")
        if kind not in AUTOPILOTS:
            raise DriveError(f"the autopilot at {where} is of kind {kind}, not ArduPilot or PX4")
        self._autopilot, timeout = AUTOPILOTS[kind]
        interval_us = 1e6 * REPORT_EVERY_S
        self._command(MAV.MAV_CMD_SET_MESSAGE_INTERVAL, MAV.MAVLINK_MSG_ID_SYS_STATUS, interval_us)
        answer = self._ask(
            lambda: line.param_set_send(timeout, ACTION_TIMEOUT_S),
            "PARAM_VALUE",
            lambda m: m.param_id == timeout and abs(m.param_value - ACTION_TIMEOUT_S) < 1e-6,
        )
        self._ends_itself = answer is not None
        with self._sending:
            line.set_mode("MANUAL")
        if self.options.rover_arm and not self._is_armed:
            self._drive(Action.STOP, None, 1.0)
            self._command(MAV.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            self._is_armed = self._has_armed = True

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        line = self._connected()
        steering, throttle = point or point_of(action, self.declared_moves) or Point(0.0, 0.0)
        if not self._is_armed and action is not Action.STOP:
            raise DriveError("the rover is disarmed; arm it, or start with --rover-arm true")
        side = round(1000 * steering)
        ahead = round(1000 * throttle * speed_scale * self.options.rover_throttle)
        if self._autopilot == "PX4":  # its throttle goes from 0 (full reverse) to 1000
            ahead = 500 + round(ahead / 2)
        with self._sending:
            line.mav.manual_control_send(line.target_system, 0, side, ahead, side, 0)

    def _sense(self) -> Sensors:
        if self._clock.now_s() - self._beaten_s >= HEARTBEAT_EVERY_S:
            with self._sending:
                self._beat()
        line = self._connected()
        while (message := line.recv_match()) is not None:
            self._take(message)
        return Sensors(battery_share=self._battery)

    def _beat(self) -> None:
        self._beaten_s = self._clock.now_s()
        self._connected().mav.heartbeat_send(MAV.MAV_TYPE_GCS, NO_AUTOPILOT, 0, 0, 0)

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "BAD_DATA" or message.get_srcSystem() != self._connected().target_system:
            return
        self.heard()
        if kind == "HEARTBEAT" and message.autopilot != NO_AUTOPILOT:
            self._is_armed = bool(message.base_mode & MAV.MAV_MODE_FLAG_SAFETY_ARMED)
        elif kind == "SYS_STATUS":
            left = message.battery_remaining
            self._battery = left / 100 if 0 <= left <= 100 else None
        elif kind == "STATUSTEXT":
            self._said = message.text

    def _close(self, connection: Any) -> None:
        if self._has_armed:
            with self._sending:
                connection.mav.command_long_send(
                    connection.target_system, 1, MAV.MAV_CMD_COMPONENT_ARM_DISARM, 0, *7 * [0]
                )
        connection.close()

    def _command(self, command: int, *numbers: float) -> None:
        """Send a command; raises DriveError if the rover refuses it or does not answer."""
        line = self._connected()
        given = (*numbers, *(7 - len(numbers)) * [0])
        answer = self._ask(
            lambda: line.mav.command_long_send(line.target_system, 1, command, 0, *given),
            "COMMAND_ACK",
            lambda m: m.command == command and m.result != MAV.MAV_RESULT_IN_PROGRESS,
        )
        if answer is None or answer.result != MAV.MAV_RESULT_ACCEPTED:
            name = MAV.enums["MAV_CMD"][command].name
            why = "no answer" if answer is None else MAV.enums["MAV_RESULT"][answer.result].name
            raise DriveError(f"the rover refused {name}: {why}. It reports: {self._said or '-'}")

    def _ask(self, send: Callable[[], Any], kind: str, is_answer: Callable[[Any], bool]) -> Any:
        """Send up to three times; return the answer, a message of this kind, or None."""
        line = self._connected()
        for _ in range(3):
            with self._sending:
                send()
            end_s = self._clock.now_s() + ANSWER_S
            while (left_s := end_s - self._clock.now_s()) > 0:
                message = line.recv_match(blocking=True, timeout=left_s)
                if message is not None:
                    self._take(message)
                    if message.get_type() == kind and is_answer(message):
                        return message
        return None
