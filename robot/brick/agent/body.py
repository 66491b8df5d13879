"""The body of the brick: motors, sensors, lights, buttons and screen."""

import fcntl
import os
import struct
import sys
import time
from typing import Any, Dict, List, Optional, Tuple

from robot.brick.agent.ports import DevicePort, HardwareError, find_port

ULTRASONIC = ["lego-ev3-us", "lego-nxt-us"]
TOUCH = ["lego-ev3-touch", "lego-nxt-touch"]
LIGHTS = {"starting": (1, 1), "stopped": (0, 1), "train": (1, 1), "autonomous": (1, 0)}
"""Mode to how much red and green; starting shows on the left light only."""
KEY_EVENT = struct.Struct("@llHHi")
KEY_ENTER = 28


class BrickBody:
    """The brick's body. `open` finds the devices; whatever fails raises HardwareError."""

    def __init__(self, left: str, right: str, ultrasonic: str, touch: str, root: str = "/") -> None:
        self._addresses = (left, right)
        self._wanted = {
            "ultrasonic": ("ultrasonic", ultrasonic, ULTRASONIC),
            "touch": ("touch", touch, TOUCH),
        }
        self._root = root
        self._motors = []  # type: List[DevicePort]
        self._counts = []  # type: List[float]
        self._speeds = [None, None]  # type: List[Optional[int]]
        self._time_ms = 0
        self._sensors = {}  # type: Dict[str, Optional[DevicePort]]
        self._units_m = 0.001
        self._battery = None  # type: Optional[Tuple[float, float, DevicePort]]
        self._battery_share = None  # type: Optional[float]
        self._battery_read_s = -60.0
        self._keys = -1
        self._shown = ""

    def open(self) -> None:
        """Find motors, sensors, battery and buttons, and make sure that nothing moves."""
        try:
            import ev3dev2
        except ImportError:
            raise HardwareError(
                "python-ev3dev2 is not installed; install it with: pip install 'drivelesson[ev3]'"
            ) from None
        ev3dev2.Device.DEVICE_ROOT_PATH = os.path.join(self._root, "sys/class")
        try:
            self._open_motors()
            for name, address, drivers in self._wanted.values():
                self._open_sensor(name, address, drivers)
            self._open_battery()
            self._open_keys()
        except HardwareError:
            raise
        except Exception as error:
            raise HardwareError(
                "the brick's devices cannot be used ({}); be root, or a member of the group "
                "ev3dev".format(error)
            ) from error

    def _open_motors(self) -> None:
        motors = []
        for side, address in zip(("left", "right"), self._addresses):
            motor = find_port("tacho-motor", "motor*", address=address)
            if motor is None:
                raise HardwareError(
                    "no {} motor at port {}; plug it in there, or name its port with "
                    "--{}-port ({})".format(side, address, side, self._found("tacho-motor"))
                )
            motors.append(motor)
        # The old ones, if any, were lost.
        self._forget_motors()
        self._counts = [float(motor.read("count_per_rot")) / 360.0 for motor in motors]
        self._speeds, self._time_ms = [None, None], 0
        self._motors = motors
        for motor in motors:
            motor.write("stop_action", "brake")
            motor.write("command", "stop")

    def _open_sensor(self, name: str, address: str, drivers: List[str]) -> None:
        if address == "none":
            return
        wanted = {} if address == "auto" else {"address": address}
        sensor = find_port("lego-sensor", "sensor*", driver_name=drivers, **wanted)
        if sensor is None:
            if address == "auto":
                return
            raise HardwareError(
                "no {} sensor at port {}; plug it in there, or say where with --{}-port: its "
                "port, auto or none ({})".format(name, address, name, self._found("lego-sensor"))
            )
        if name == "ultrasonic":
            sensor.write("mode", "US-DIST-CM")
            self._units_m = 0.01 / 10 ** int(sensor.read("decimals"))
        self._sensors[name] = sensor

    def _found(self, kind: str) -> str:
        """Say what is plugged in instead, for an error."""
        folder = os.path.join(self._root, "sys/class", kind)
        found = []
        for name in sorted(os.listdir(folder)) if os.path.isdir(folder) else []:
            lines = []
            for attribute in ("driver_name", "address"):
                with open(os.path.join(folder, name, attribute)) as file:
                    lines.append(file.readline().strip())
            found.append(" at ".join(lines))
        return "found: " + (", ".join(found) or "nothing")

    def _open_battery(self) -> None:
        battery = find_port("power_supply", "*ev3-battery")
        if battery is not None:
            lowest, highest = (float(battery.read("voltage_%s_design" % x)) for x in ("min", "max"))
            self._battery = (lowest, highest, battery)

    def _open_keys(self) -> None:
        path = os.path.join(self._root, "dev/input/by-path/platform-gpio_keys-event")
        if self._keys < 0 and os.path.exists(path):
            self._keys = os.open(path, os.O_RDONLY | os.O_NONBLOCK)

    def run(self, left_dps: float, right_dps: float, time_ms: int) -> None:
        """Turn the wheels at so many degrees a second for at most `time_ms`.

        A motor that was unplugged is looked for again first.
        """
        try:
            if not self._motors:
                self._open_motors()
            for index, speed_dps in enumerate((left_dps, right_dps)):
                self._set_speed(index, int(round(speed_dps * self._counts[index])), time_ms)
            self._time_ms = time_ms
            for index, motor in enumerate(self._motors):
                motor.write("command", "run-timed" if self._speeds[index] else "stop")
        except HardwareError:
            raise
        except Exception as error:
            self.stop()
            self._forget_motors()
            raise HardwareError(
                "the motors at {} and {} do not answer ({}); check their cables".format(
                    self._addresses[0], self._addresses[1], error
                )
            ) from error

    def _forget_motors(self) -> None:
        for motor in self._motors:
            motor.close()
        self._motors = []

    def _set_speed(self, index: int, speed: int, time_ms: int) -> None:
        """Write only what changed: each write costs a millisecond on the brick."""
        motor = self._motors[index]
        if time_ms != self._time_ms:
            motor.write("time_sp", time_ms)
        if speed != self._speeds[index]:
            motor.write("speed_sp", speed)
            self._speeds[index] = speed

    def stop(self) -> None:
        """Stop both motors, one even if the other is gone. Never raises."""
        for motor in self._motors:
            try:
                motor.write("command", "stop")
            except Exception as error:
                print("cannot stop {}: {}".format(motor.address, error), file=sys.stderr)

    def positions(self) -> List[float]:
        """How far each wheel has turned since power-on, in degrees; left, right."""
        return [
            float(motor.read("position")) / count
            for motor, count in zip(self._motors, self._counts)
        ]

    def sense(self) -> Dict[str, Any]:
        """Return distance_m, bumped and battery_share; None for what is not there."""
        return {
            "distance_m": self._read_distance(),
            "bumped": self._read_bumped(),
            "battery_share": self._read_battery(),
        }

    def _value(self, name: str) -> Optional[int]:
        """A sensor's reading; None if there never was one. A lost one is looked for again."""
        if name not in self._sensors:
            return None
        try:
            if self._sensors[name] is None:
                self._open_sensor(*self._wanted[name])
            sensor = self._sensors[name]
            if sensor is None:
                raise OSError("it was unplugged")
            return int(sensor.read("value0"))
        except Exception as error:
            lost, self._sensors[name] = self._sensors[name], None
            if lost is not None:
                lost.close()
            raise HardwareError(
                "the {} sensor does not answer ({}); check its cable".format(name, error)
            ) from error

    def _read_distance(self) -> Optional[float]:
        value = self._value("ultrasonic")
        return None if value is None else value * self._units_m

    def _read_bumped(self) -> Optional[bool]:
        value = self._value("touch")
        return None if value is None else value != 0

    def _read_battery(self) -> Optional[float]:
        """Charge between 0 and 1, as the voltage tells it; read every five seconds."""
        now_s = time.monotonic()
        if self._battery is not None and now_s - self._battery_read_s > 5.0:
            lowest, highest, battery = self._battery
            self._battery_read_s = now_s
            try:
                share = (float(battery.read("voltage_now")) - lowest) / (highest - lowest)
            except Exception:
                return None
            self._battery_share = min(1.0, max(0.0, share))
        return self._battery_share

    def take_button(self) -> Optional[str]:
        """Return "start" (the middle button) or "stop" (any other) if one was pressed."""
        pressed = None
        while self._keys >= 0:
            try:
                event = os.read(self._keys, KEY_EVENT.size)
            except BlockingIOError:
                break
            if len(event) < KEY_EVENT.size:
                break
            _, _, kind, code, value = KEY_EVENT.unpack(event)
            if kind == 1 and value == 1:
                pressed = "start" if code == KEY_ENTER and pressed != "stop" else "stop"
        return pressed

    def show(self, mode: str, address: str) -> None:
        """Say mode and address on screen and lights; what is not there is left out."""
        text = "Drivelesson\r\n\n{}\r\n\n{}\r\n".format(mode, address)
        if text == self._shown:
            return
        self._shown = text
        red, green = LIGHTS.get(mode, (0, 1))
        for side in (0, 1):
            lit = mode != "starting" or side == 0
            self._light("led{}:red:brick-status".format(side), red and lit)
            self._light("led{}:green:brick-status".format(side), green and lit)
        write_screen(os.path.join(self._root, "dev/tty6"), text)

    def _light(self, name: str, share: int) -> None:
        path = os.path.join(self._root, "sys/class/leds", name)
        try:
            with open(os.path.join(path, "max_brightness")) as file:
                brightness = int(file.readline()) * share
            with open(os.path.join(path, "brightness"), "w") as file:
                file.write("{}\n".format(brightness))
        except OSError:
            pass  # a robot without lights drives as well

    def close(self) -> None:
        """Stop the motors and let go of everything; idempotent."""
        self.stop()
        self._forget_motors()
        for sensor in self._sensors.values():
            if sensor is not None:
                sensor.close()
        if self._battery is not None:
            self._battery[2].close()
        self._sensors, self._battery, self._shown = {}, None, ""
        if self._keys >= 0:
            os.close(self._keys)
            self._keys = -1


def write_screen(path: str, text: str) -> None:
    """Write to a console of the brick's screen and bring it to the front (VT_ACTIVATE)."""
    try:
        with open(path, "w") as screen:
            screen.write("\033[2J\033[H" + text)
            if screen.isatty():
                fcntl.ioctl(screen, 0x5606, int(path[-1]))
    except OSError:
        pass  # not on a brick, or not allowed to
