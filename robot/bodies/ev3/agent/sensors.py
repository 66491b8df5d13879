"""Ultrasonic sensor, bumpers and battery; sensors may appear late, go and come back."""

import time
from typing import Any, Dict, List, Optional

from robot.bodies.ev3.agent.ports import (
    DevicePort,
    HardwareError,
    describe_ports,
    find_port,
    list_ports,
)

ULTRASONIC = ["lego-ev3-us", "lego-nxt-us"]
TOUCH = ["lego-ev3-touch", "lego-nxt-touch"]
SEARCH_S = 2.0
"""How often sensors that nobody named are looked for: the kernel needs seconds for some."""
BATTERY_S = 5.0


class RobotSensors:
    """What a body senses. Ports are "auto" (take what is there), "none", or names of ports.

    Several touch sensors are bumpers, from left to right: in the order in which their ports are
    named ("in4,in1"), or by port. `clock` has the functions of Python's `time`.
    """

    def __init__(self, ultrasonic: str, touch: str, root: str, clock: Any = time) -> None:
        self._clock = clock
        self._wanted = {"ultrasonic": ultrasonic, "touch": touch}
        self._root = root
        self._ultrasonic = None  # type: Optional[DevicePort]
        self._touch = []  # type: List[DevicePort]
        self._expected = {"ultrasonic": 0, "touch": 0}
        self._metres_per_unit = 0.001
        self._battery = None  # type: Optional[DevicePort]
        self._battery_range = (0.0, 1.0)
        self._battery_share = None  # type: Optional[float]
        self._battery_read_s = None  # type: Optional[float]
        self._searched_s = 0.0

    def open(self) -> None:
        """Find the sensors; one that was named must be there."""
        self._find_ultrasonic()
        self._find_touch()
        self._searched_s = self._clock.monotonic()
        battery = find_port("power_supply", "*ev3-battery")
        if battery is not None:
            low, high = (float(battery.read("voltage_%s_design" % end)) for end in ("min", "max"))
            self._battery, self._battery_range = battery, (low, high)

    def read(self) -> Dict[str, Any]:
        """Return distance_m, bumped, bumpers and battery_share; None for what is not there.

        Raises:
            HardwareError: If a sensor that was there does not answer.
        """
        self._search()
        bumpers = self._read_bumpers()
        return {
            "distance_m": self._read_distance(),
            "bumped": any(bumpers) if bumpers else None,
            "bumpers": bumpers,
            "battery_share": self._read_battery(),
        }

    def close(self) -> None:
        """Let go of the devices; idempotent."""
        self._forget_touch()
        for port in (self._ultrasonic, self._battery):
            if port is not None:
                port.close()
        self._ultrasonic, self._battery = None, None
        self._expected = {"ultrasonic": 0, "touch": 0}

    def _search(self) -> None:
        """Look now and then for sensors that nobody named and that were not there at first."""
        now_s = self._clock.monotonic()
        if now_s - self._searched_s < SEARCH_S:
            return
        self._searched_s = now_s
        if self._wanted["ultrasonic"] == "auto" and self._ultrasonic is None:
            self._find_ultrasonic()
        if self._wanted["touch"] == "auto" and len(self._touch_ports()) > len(self._touch):
            self._find_touch()

    def _find_ultrasonic(self) -> None:
        wanted = self._wanted["ultrasonic"]
        if wanted == "none":
            return
        named = {} if wanted == "auto" else {"address": wanted}
        sensor = find_port("lego-sensor", "sensor*", driver_name=ULTRASONIC, **named)
        if sensor is None:
            if wanted != "auto":
                raise self._missing("ultrasonic", wanted)
            return
        sensor.write("mode", "US-DIST-CM")
        self._metres_per_unit = 0.01 / 10 ** int(sensor.read("decimals"))
        self._ultrasonic = sensor
        self._expected["ultrasonic"] = 1

    def _touch_ports(self) -> List[str]:
        """The ports of the touch sensors, from left to right."""
        wanted = self._wanted["touch"]
        if wanted == "none":
            return []
        if wanted != "auto":
            return [port.strip() for port in wanted.split(",")]
        found = list_ports(self._root, "lego-sensor")
        return [entry["address"] for entry in found if entry["driver_name"] in TOUCH]

    def _find_touch(self) -> None:
        self._forget_touch()
        for port in self._touch_ports():
            sensor = find_port("lego-sensor", "sensor*", driver_name=TOUCH, address=port)
            if sensor is None:
                raise self._missing("touch", port)
            self._touch.append(sensor)
        self._expected["touch"] = max(self._expected["touch"], len(self._touch))

    def _missing(self, name: str, port: str) -> HardwareError:
        return HardwareError(
            "no {} sensor at port {}; plug it in there, or say where with --{}-port: its "
            "port, auto or none ({})".format(
                name, port, name, describe_ports(self._root, "lego-sensor")
            )
        )

    def _lost(self, name: str, error: object) -> HardwareError:
        return HardwareError(
            "the {} sensor does not answer ({}); check its cable".format(name, error)
        )

    def _forget_touch(self) -> None:
        for port in self._touch:
            port.close()
        self._touch = []

    def _read_distance(self) -> Optional[float]:
        if not self._expected["ultrasonic"]:
            return None
        try:
            if self._ultrasonic is None:
                self._find_ultrasonic()
            if self._ultrasonic is None:
                raise OSError("it was unplugged")
            return int(self._ultrasonic.read("value0")) * self._metres_per_unit
        except Exception as error:
            if self._ultrasonic is not None:
                self._ultrasonic.close()
                self._ultrasonic = None
            raise self._lost("ultrasonic", error) from error

    def _read_bumpers(self) -> List[bool]:
        if not self._expected["touch"]:
            return []
        try:
            if not self._touch:
                self._find_touch()
            if len(self._touch) < self._expected["touch"]:
                raise OSError("one was unplugged")
            return [int(port.read("value0")) != 0 for port in self._touch]
        except Exception as error:
            self._forget_touch()
            raise self._lost("touch", error) from error

    def _read_battery(self) -> Optional[float]:
        """Charge between 0 and 1, estimated from the voltage; read every five seconds."""
        now_s = self._clock.monotonic()
        is_due = self._battery_read_s is None or now_s - self._battery_read_s > BATTERY_S
        if self._battery is not None and is_due:
            self._battery_read_s = now_s
            low, high = self._battery_range
            try:
                share = (float(self._battery.read("voltage_now")) - low) / (high - low)
            except Exception:
                return None
            self._battery_share = min(1.0, max(0.0, share))
        return self._battery_share
