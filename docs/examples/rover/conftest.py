"""Simulates a rover that exchanges real MAVLink messages over UDP on this machine."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from drivelesson_rover import MAV, RoverDriver, RoverOptions, mavutil

from robot.testing.cases import DriverCase
from robot.types import Point

TIMEOUTS = {
    MAV.MAV_AUTOPILOT_ARDUPILOTMEGA: "RC_OVERRIDE_TIME",
    MAV.MAV_AUTOPILOT_PX4: "COM_RC_LOSS_T",
}


class Rover:
    """The autopilot's side of the driver's messages. It does not acknowledge MANUAL_CONTROL."""

    def __init__(
        self, autopilot: int = MAV.MAV_AUTOPILOT_ARDUPILOTMEGA, may_arm: bool = True
    ) -> None:
        self.autopilot, self.may_arm = autopilot, may_arm
        self.parameters = {TIMEOUTS[autopilot]: 3.0}
        self.line = mavutil.mavudp("127.0.0.1:0", input=True, source_system=1)
        self.address = f"udpout:127.0.0.1:{self.line.port.getsockname()[1]}"
        self.is_cut = self.is_armed = self.is_manual = False
        self.steering = self.throttle = 0.0
        self.told_s = self.status_every_s = float("-inf")
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run)

    def drives(self) -> Point:
        is_lost = time.monotonic() - self.told_s > self.parameters[TIMEOUTS[self.autopilot]]
        if is_lost or not (self.is_armed and self.is_manual):
            return Point(0.0, 0.0)
        return Point(self.steering, self.throttle)

    def run(self) -> None:
        beat_s = status_s = 0.0
        while not self.ending.is_set():
            message = self.line.recv_match(blocking=True, timeout=0.01)
            if message is not None and not self.is_cut:
                self.take(message)
            now_s = time.monotonic()
            if self.is_cut:
                continue
            if now_s - beat_s > 1.0:
                beat_s = now_s
                mode = MAV.MAV_MODE_FLAG_SAFETY_ARMED if self.is_armed else 0
                self.line.mav.heartbeat_send(MAV.MAV_TYPE_GROUND_ROVER, self.autopilot, mode, 0, 3)
            if 0 < self.status_every_s < now_s - status_s:
                status_s = now_s
                self.line.mav.sys_status_send(0, 0, 0, 500, 12_000, 10, 80, 0, 0, 0, 0, 0, 0)

    def take(self, message: Any) -> None:
        mav, kind = self.line.mav, message.get_type()
        if kind == "MANUAL_CONTROL":
            self.told_s, z = time.monotonic(), message.z
            self.steering = message.y / 1000
            is_px4 = self.autopilot == MAV.MAV_AUTOPILOT_PX4
            self.throttle = (z - 500) / 500 if is_px4 else z / 1000
        elif kind == "PARAM_SET" and message.param_id in self.parameters:
            self.parameters[message.param_id] = message.param_value
            name, value = message.param_id.encode(), message.param_value
            mav.param_value_send(name, value, MAV.MAV_PARAM_TYPE_REAL32, 1, 0)
        elif kind == "COMMAND_LONG":
            mav.command_ack_send(message.command, self.obey(message))

    def obey(self, message: Any) -> int:
        if message.command == MAV.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.status_every_s = message.param2 / 1e6
        elif message.command == MAV.MAV_CMD_DO_SET_MODE:
            self.is_manual = True
        elif message.command == MAV.MAV_CMD_COMPONENT_ARM_DISARM:
            if message.param1 and not self.may_arm:
                self.line.mav.statustext_send(MAV.MAV_SEVERITY_CRITICAL, b"PreArm: no GPS")
                return int(MAV.MAV_RESULT_FAILED)
            self.is_armed = bool(message.param1)
        return int(MAV.MAV_RESULT_ACCEPTED)


@contextmanager
def rover(**about: Any) -> Iterator[Rover]:
    body = Rover(**about)
    body.thread.start()
    try:
        yield body
    finally:
        body.ending.set()
        body.thread.join()
        body.line.close()


@contextmanager
def stand_in() -> Iterator[DriverCase]:
    with rover() as body:
        driver = RoverDriver(RoverOptions(rover_address=body.address, rover_arm=True))
        yield DriverCase(
            driver,
            time.sleep,
            lambda: body.drives().throttle != 0.0,
            lambda: setattr(body, "is_cut", True),
            restore_link=lambda: setattr(body, "is_cut", False),
            drives=body.drives,
        )
        driver.disconnect()


def pytest_drivelesson_driver(name: str) -> AbstractContextManager[DriverCase] | None:
    return stand_in() if name == "rover" else None
