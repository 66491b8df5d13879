"""Reads the ultrasonic sensor, the bumpers and the battery. A sensor may appear late, vanish and
return."""

import time
from typing import Any, Dict, List, Optional

from robot.bodies.ev3.agent.ports import (
    DevicePort,
    DriveError,
    describe_ports,
    find_battery,
    list_ports,
)

ULTRASONIC = ["lego-ev3-us", "lego-nxt-us"]
TOUCH = ["lego-ev3-touch", "lego-nxt-touch"]
SEARCH_S = 2.0
"""Interval at which sensors without a named port are searched for, in seconds. The search is
repeated, because the kernel takes seconds to find some sensors."""
BATTERY_S = 5.0


class SensorGroup:
    """Sensors of one kind. `wanted` is "auto" for all sensors that are found, "none", or a list of
    ports.

    The sensors have the order of the named ports. If no port is named, the sensors are sorted by
    port. `most` limits the number of sensors.
    """

    def __init__(
        self, name: str, drivers: List[str], wanted: str, root: str, most: int = 4, mode: str = ""
    ) -> None:
        self._name = name
        self._drivers = drivers
        self._wanted = wanted
        self._root = root
        self._most = most
        self._mode = mode
        self._expected = 0
        self._ports = []  # type: List[DevicePort]
        self._units = []  # type: List[int]

    def find(self) -> None:
        """Open the sensors; raises DriveError if a named sensor is missing."""
        self._forget()
        self._ports = self._choose()
        for port in self._ports:
            if self._mode:
                port.write("mode", self._mode)
        self._units = [10 ** int(port.read("decimals")) for port in self._ports]
        self._expected = max(self._expected, len(self._ports))

    def read(self, looks_for_more: bool) -> List[float]:
        """Return each sensor's value in the unit of its mode. With `looks_for_more`, also search
        for sensors that have been plugged in since the last search. Raises DriveError if a known
        sensor does not answer; the next call searches for it."""
        try:
            wanted = min(1, self._expected)
            if looks_for_more and self._wanted == "auto":
                wanted = len(self._choose())
            if len(self._ports) < wanted:
                self.find()
            if len(self._ports) < self._expected:
                raise OSError("it was unplugged")
            return [int(x.read("value0")) / unit for x, unit in zip(self._ports, self._units)]
        except Exception as error:
            self._forget()
            raise DriveError(
                "the {} sensor does not answer ({}); check its cable".format(self._name, error)
            ) from error

    def close(self) -> None:
        self._forget()
        self._expected = 0

    def _choose(self) -> List[DevicePort]:
        if self._wanted == "none":
            return []
        there = list_ports(self._root, "lego-sensor")
        ours = [port for port in there if port.driver in self._drivers]
        if self._wanted == "auto":
            return ours[: self._most]
        chosen = []
        for address in self._wanted.split(","):
            at_it = [port for port in ours if port.is_at(address)]
            if not at_it:
                raise DriveError(
                    "no {} sensor at port {}; plug it in there, or set --{}-port to its port, auto "
                    "or none ({})".format(self._name, address, self._name, describe_ports(there))
                )
            chosen.append(at_it[0])
        return chosen[: self._most]

    def _forget(self) -> None:
        for port in self._ports:
            port.close()
        self._ports = []


class RobotSensors:
    """The sensors of a body; the arguments are as for `SensorGroup`.

    The touch sensors are the bumpers, from left to right. `clock` has the functions of the
    module `time`.
    """

    def __init__(self, ultrasonic: str, touch: str, root: str, clock: Any = time) -> None:
        self._clock, self._root = clock, root
        self._ultrasonic = SensorGroup("ultrasonic", ULTRASONIC, ultrasonic, root, 1, "US-DIST-CM")
        self._touch = SensorGroup("touch", TOUCH, touch, root)
        self._battery = None  # type: Optional[DevicePort]
        self._battery_share = None  # type: Optional[float]
        self._battery_read_s = float("-inf")
        self._searched_s = 0.0

    def open(self) -> None:
        self._ultrasonic.find()
        self._touch.find()
        self._searched_s = self._clock.monotonic()
        self._battery = find_battery(self._root)

    def read(self) -> Dict[str, Any]:
        """Return a dict with `distance_m`, `bumped`, `battery_share` and `bumpers`.

        The first three are None if the sensor is missing. `bumpers` is a list with one bool per
        touch sensor: True if the sensor is pressed. Raises DriveError if a known sensor does not
        answer.
        """
        now_s = self._clock.monotonic()
        is_due = now_s - self._searched_s >= SEARCH_S
        if is_due:
            self._searched_s = now_s
        bumpers = [value != 0 for value in self._touch.read(is_due)]
        distances_cm = self._ultrasonic.read(is_due)
        return {
            "distance_m": distances_cm[0] / 100 if distances_cm else None,
            "bumped": any(bumpers) if bumpers else None,
            "bumpers": bumpers,
            "battery_share": self._read_battery(now_s),
        }

    def close(self) -> None:
        self._ultrasonic.close()
        self._touch.close()
        if self._battery is not None:
            self._battery.close()
            self._battery = None

    def _read_battery(self, now_s: float) -> Optional[float]:
        """Return the charge from 0 to 1, estimated from the voltage, which is read every five
        seconds."""
        if self._battery is not None and now_s - self._battery_read_s > BATTERY_S:
            self._battery_read_s = now_s
            names = ("voltage_min_design", "voltage_max_design", "voltage_now")
            try:
                low, high, volts = [float(self._battery.read(name)) for name in names]
                self._battery_share = min(1.0, max(0.0, (volts - low) / (high - low)))
            except Exception:
                return None
        return self._battery_share
