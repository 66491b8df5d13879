#!/usr/bin/env python3
"""Motors, sensors and camera of an EV3, and a small agent that lends them to a server elsewhere.

One file on purpose: `drivelesson brick agent ADDRESS` copies it to a brick with the stock image,
so it is written for Python 3.5, the standard library and python-ev3dev2 alone. On a brick that
runs the server itself the drivers import it and use `Body` and `Video` without the network.

Safety sits here, next to the motors: every move is a `run-timed` that the kernel ends by itself,
the agent stops the motors when its controller falls silent or leaves, and old words are dropped.
"""

import argparse
import fcntl
import json
import mmap
import os
import select
import signal
import socket
import stat
import struct
import sys
import time
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

PORT = 8765
PROTOCOL = 1
WATCHDOG_S = 0.5
"""So long after the last command the motors are stopped, whatever was asked."""
SILENCE_S = 1.5
"""A controller that says nothing for so long is gone, and another may come."""
STALE_S = 0.3
"""A command that was held up on the way for longer than this is not carried out."""
REOPEN_S = 0.5
"""How often a lost camera is looked for."""
STILL_S = 0.35
"""A camera that shows nothing new for so long is broken: noticed within 500 ms."""


class HardwareError(Exception):
    """A motor, sensor or camera is missing or failed; the sentence says which and what to do."""


# The body: motors, sensors, lights, buttons and screen ------------------------------------------


class Port:
    """One device of the kernel's; its attribute files stay open, since opening costs more."""

    def __init__(self, device: Any, address: str) -> None:
        self.address = address
        self._device = device
        self._files = {}  # type: Dict[str, Any]

    def read(self, name: str) -> str:
        """Return an attribute as text."""
        file, value = self._device.get_attr_string(self._files.get(name), name)
        self._files[name] = file
        return str(value)

    def write(self, name: str, value: object) -> None:
        """Set an attribute. It ends in a newline, as `echo` ends it, so that no longer old
        value shows behind it where the attributes are plain files."""
        self._files[name] = self._device.set_attr_raw(
            self._files.get(name), name, "{}\n".format(value)
        )

    def close(self) -> None:
        """Close the attribute files; the next use opens them again."""
        for file in self._files.values():
            file.close()
        self._files.clear()


def find_port(kind: str, pattern: str, **attributes: Any) -> Optional[Port]:
    """Return the first device of a class whose attributes match, or None."""
    from ev3dev2 import Device, DeviceNotFound

    try:
        return Port(Device(kind, pattern, **attributes), attributes.get("address", ""))
    except DeviceNotFound:
        return None


ULTRASONIC = ["lego-ev3-us", "lego-nxt-us"]
TOUCH = ["lego-ev3-touch", "lego-nxt-touch"]
LIGHTS = {"starting": (1, 1), "stopped": (0, 1), "train": (1, 1), "autonomous": (1, 0)}
"""Mode to how much red and green; starting shows on the left light only."""
KEY_EVENT = struct.Struct("@llHHi")
KEY_ENTER = 28


class Body:
    """The brick's body. `open` finds the devices; whatever fails raises HardwareError."""

    def __init__(self, left: str, right: str, ultrasonic: str, touch: str, root: str = "/") -> None:
        self._addresses = (left, right)
        self._wanted = {
            "ultrasonic": ("ultrasonic", ultrasonic, ULTRASONIC),
            "touch": ("touch", touch, TOUCH),
        }
        self._root = root
        self._motors = []  # type: List[Port]
        self._counts = []  # type: List[float]
        self._speeds = [None, None]  # type: List[Optional[int]]
        self._time_ms = 0
        self._sensors = {}  # type: Dict[str, Optional[Port]]
        self._units_m = 0.001
        self._battery = None  # type: Optional[Tuple[float, float, Port]]
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


# The camera, by the kernel's Video4Linux interface ------------------------------------------------

FMT = struct.Struct("@I0L200s")
PIX = struct.Struct("=IIIIII")
BUFFER = struct.Struct("@5Ill16s2IL3I0L")
CAPTURE, MMAP = 1, 1
FLAG_ERROR, FLAG_MONOTONIC, CLOCK_MASK = 0x40, 0x2000, 0xE000
CAN_CAPTURE, CAN_STREAM, DEVICE_CAPS = 0x1, 0x04000000, 0x80000000
FOURCC = {"yuyv": b"YUYV", "jpeg": b"MJPG"}
N_BUFFERS = 2

VideoFrame = NamedTuple("VideoFrame", [("data", bytes), ("taken_s", float)])
"""The bytes as the camera gave them, and when, on this machine's monotonic clock."""


def ioctl_number(way: int, number: int, size: int) -> int:
    """Return the kernel's number of a video ioctl; way is 1 write, 2 read, 3 both."""
    return way << 30 | size << 16 | ord("V") << 8 | number


QUERYCAP = ioctl_number(2, 0, 104)
ENUM_FMT = ioctl_number(3, 2, 64)
S_FMT = ioctl_number(3, 5, FMT.size)
REQBUFS = ioctl_number(3, 8, 20)
QUERYBUF = ioctl_number(3, 9, BUFFER.size)
QBUF = ioctl_number(3, 15, BUFFER.size)
DQBUF = ioctl_number(3, 17, BUFFER.size)
STREAMON = ioctl_number(1, 18, 4)
STREAMOFF = ioctl_number(1, 19, 4)
S_PARM = ioctl_number(3, 22, 204)


class Video:
    """One streaming camera. Ready to `read` when its `fileno` is readable."""

    def __init__(self, device: str, width: int, height: int, rate: int, encoding: str) -> None:
        self.path = first_camera() if device == "auto" else device
        self._fd = self._open_device(self.path)
        self._maps = []  # type: List[mmap.mmap]
        try:
            self._check_abilities()
            self.encoding = self._choose_encoding(encoding)
            self.width, self.height, self._stride = self._set_format(width, height)
            self._set_rate(rate)
            self._map_buffers()
            fcntl.ioctl(self._fd, STREAMON, struct.pack("i", CAPTURE))
        except OSError as error:
            self.close()
            raise HardwareError(
                "the camera {} refused: {}; unplug it and plug it in again".format(
                    self.path, error.strerror
                )
            ) from error
        except HardwareError:
            self.close()
            raise

    @staticmethod
    def _open_device(path: str) -> int:
        try:
            return os.open(path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise HardwareError(
                "no camera at {} ({}); plug it in, or name its device with --device".format(
                    path, error.strerror
                )
            ) from error

    def _check_abilities(self) -> None:
        data = fcntl.ioctl(self._fd, QUERYCAP, bytes(104))
        abilities, of_device = struct.unpack_from("=II", data, 84)
        if abilities & DEVICE_CAPS:
            abilities = of_device
        if not (abilities & CAN_CAPTURE and abilities & CAN_STREAM):
            raise HardwareError(
                "{} is no camera that streams; name another with --device".format(self.path)
            )

    def _choose_encoding(self, wanted: str) -> str:
        """YUYV where there is a choice: it needs no decoder here, and the page can show it."""
        offered = []
        for index in range(64):
            try:
                data = fcntl.ioctl(
                    self._fd, ENUM_FMT, struct.pack("=II", index, CAPTURE) + bytes(56)
                )
            except OSError:
                break
            offered.append(data[44:48])
        for name in ("yuyv", "jpeg") if wanted == "auto" else (wanted,):
            if FOURCC[name] in offered:
                return name
        raise HardwareError(
            "the camera {} gives no {}; it offers: {}".format(
                self.path,
                "YUYV or MJPEG" if wanted == "auto" else wanted,
                ", ".join(code.decode("ascii", "replace") for code in offered) or "nothing",
            )
        )

    def _set_format(self, width: int, height: int) -> Tuple[int, int, int]:
        """Ask for a size; the camera answers with the nearest it has, and its bytes per row."""
        code = struct.unpack("=I", FOURCC[self.encoding])[0]
        wanted = PIX.pack(width, height, code, 1, 0, 0)
        data = fcntl.ioctl(self._fd, S_FMT, FMT.pack(CAPTURE, wanted))
        width, height, given, _, stride, _ = PIX.unpack_from(FMT.unpack(data)[1])
        if given != code:
            raise HardwareError("the camera {} changed its format".format(self.path))
        return width, height, stride

    def _set_rate(self, rate: int) -> None:
        parm = struct.pack("=IIIII", CAPTURE, 0, 0, 1, rate) + bytes(184)
        try:
            fcntl.ioctl(self._fd, S_PARM, parm)
        except OSError:
            pass  # a camera with one fixed rate

    def _buffer(self, index: int) -> bytearray:
        zeros = bytes(16)
        return bytearray(BUFFER.pack(index, CAPTURE, 0, 0, 0, 0, 0, zeros, 0, MMAP, 0, 0, 0, 0))

    def _map_buffers(self) -> None:
        data = fcntl.ioctl(self._fd, REQBUFS, struct.pack("=5I", N_BUFFERS, CAPTURE, MMAP, 0, 0))
        for index in range(struct.unpack_from("=I", data)[0]):
            buffer = self._buffer(index)
            fcntl.ioctl(self._fd, QUERYBUF, buffer)
            fields = BUFFER.unpack(buffer)
            self._maps.append(
                mmap.mmap(self._fd, fields[11], mmap.MAP_SHARED, offset=fields[10] & 0xFFFFFFFF)
            )
            fcntl.ioctl(self._fd, QBUF, buffer)

    def fileno(self) -> int:
        """The descriptor to wait on."""
        return self._fd

    def read(self) -> Optional[VideoFrame]:
        """Return the newest waiting picture and drop older ones; None if none waits.

        Raises:
            OSError: If the camera is gone.
        """
        newest = None
        while True:
            buffer = self._buffer(0)
            try:
                fcntl.ioctl(self._fd, DQBUF, buffer)
            except BlockingIOError:
                return newest
            fields = BUFFER.unpack(buffer)
            if not fields[3] & FLAG_ERROR:
                newest = self._take(fields) or newest
            fcntl.ioctl(self._fd, QBUF, buffer)

    def _take(self, fields: Tuple[Any, ...]) -> Optional[VideoFrame]:
        index, used, flags = fields[0], fields[2], fields[3]
        taken_s = fields[5] + fields[6] / 1e6
        if flags & CLOCK_MASK != FLAG_MONOTONIC:
            taken_s = time.monotonic()
        data = self._maps[index][:used]
        if self.encoding == "yuyv":
            row = 2 * self.width
            if len(data) < self._stride * self.height or self._stride < row:
                return None  # a torn picture
            if self._stride > row:
                rows = (data[y * self._stride :][:row] for y in range(self.height))
                data = b"".join(rows)
            data = data[: row * self.height]
        return VideoFrame(data, taken_s) if data else None

    def close(self) -> None:
        """Stop streaming and let go of the device; idempotent."""
        if self._fd >= 0:
            try:
                fcntl.ioctl(self._fd, STREAMOFF, struct.pack("i", CAPTURE))
            except OSError:
                pass  # it is gone
            for picture in self._maps:
                picture.close()
            os.close(self._fd)
            self._fd = -1


def first_camera() -> str:
    """Return the first video device that there is; /dev/video0 if there is none."""
    names = [name for name in os.listdir("/dev") if name.startswith("video")]
    numbers = sorted(int(name[5:]) for name in names if name[5:].isdigit())
    return "/dev/video{}".format(numbers[0] if numbers else 0)


class Freshness:
    """Tells a living camera from one that is silent or shows one picture for ever. Pure."""

    def __init__(self, now_s: float) -> None:
        self._new_s = now_s
        self._seen_s = now_s
        self._last = b""

    def is_new(self, data: bytes, now_s: float) -> bool:
        """Take note of a picture. False for an exact repeat: a living sensor has noise."""
        self._seen_s = now_s
        if data == self._last:
            return False
        self._last, self._new_s = data, now_s
        return True

    def fault(self, now_s: float) -> Optional[str]:
        """What is wrong, or None."""
        if now_s - self._new_s <= STILL_S:
            return None
        if now_s - self._seen_s <= STILL_S:
            return "repeats one picture"
        return "gives no pictures"


class Eye:
    """A camera that is looked after: opened, watched, and opened again when it was lost."""

    def __init__(self, device: str, width: int, height: int, rate: int, encoding: str) -> None:
        self._wanted = (device, width, height, rate, encoding)
        self._freshness = Freshness(0.0)
        self._next_try_s = 0.0
        self.video = None  # type: Optional[Video]
        self.fault = None  # type: Optional[str]

    def look(self, now_s: float) -> Optional[VideoFrame]:
        """Return a new picture if there is one; never blocks, never raises. Sets `fault`."""
        if self.video is None and now_s >= self._next_try_s:
            self._reopen(now_s)
        if self.video is None:
            return None
        try:
            frame = self.video.read()
        except OSError as error:
            self._lose("was unplugged ({})".format(error.strerror), now_s)
            return None
        if frame is not None and self._freshness.is_new(frame.data, now_s):
            self.fault = None
            return frame
        wrong = self._freshness.fault(now_s)
        if wrong is not None:
            self._lose(wrong, now_s)
        return None

    def _reopen(self, now_s: float) -> None:
        self._next_try_s = now_s + REOPEN_S
        try:
            self.video = Video(*self._wanted)
        except HardwareError as error:
            self.fault = self.fault or "Camera: {}".format(error)
        else:
            last, self._freshness = self._freshness, Freshness(now_s)
            self._freshness._last = last._last

    def _lose(self, what: str, now_s: float) -> None:
        path = self.video.path if self.video else self._wanted[0]
        self.fault = "The camera {} {}; check its cable, it is picked up again.".format(path, what)
        self.close()
        self._next_try_s = now_s + REOPEN_S

    def close(self) -> None:
        """Let go of the camera; idempotent."""
        if self.video is not None:
            self.video.close()
            self.video = None


# The wire: both ways, one byte of kind, four of length, then JSON or a picture -------------------

HEAD = struct.Struct(">cI")
PICTURE = struct.Struct(">IdHHB")
"""Frame id, taken_s on the brick's clock, width, height, encoding; then the bytes."""
ENCODINGS = ("yuyv", "jpeg")
LARGEST = {b"J": 16384, b"F": 4 << 20}


def pack_json(message: Dict[str, Any]) -> bytes:
    """Return a message as it goes over the wire."""
    body = json.dumps(message).encode()
    return HEAD.pack(b"J", len(body)) + body


class Unpacker:
    """Cuts a stream of bytes into (kind, body); ValueError on what cannot be one."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def feed(self, data: bytes) -> List[Tuple[bytes, bytes]]:
        """Add bytes, and return the messages that are now whole."""
        self._waiting += data
        messages = []
        while len(self._waiting) >= HEAD.size:
            kind, size = HEAD.unpack_from(self._waiting)
            if size > LARGEST.get(kind, -1):
                raise ValueError("not a message of this protocol")
            if len(self._waiting) < HEAD.size + size:
                break
            messages.append((kind, bytes(self._waiting[HEAD.size : HEAD.size + size])))
            del self._waiting[: HEAD.size + size]
        return messages


def prove(secret: str, nonce: str) -> str:
    """Answer a challenge: proof of knowing the secret without saying it."""
    import hmac  # here, since it loads OpenSSL, which a server on the brick never needs

    return hmac.new(secret.encode(), nonce.encode(), "sha256").hexdigest()


# The agent ----------------------------------------------------------------------------------------


class Caller:
    """One connection. It may command only once it has proved that it knows the secret."""

    def __init__(self, line: socket.socket, name: str, now_s: float) -> None:
        self.line = line
        self.name = name
        self.nonce = os.urandom(16).hex()
        self.unpacker = Unpacker()
        self.outbox = b""
        self.heard_s = now_s
        self.offset_s = None  # type: Optional[float]

    def delay_s(self, said_s: float, now_s: float) -> float:
        """How much longer than the quickest word this one took; the clocks may drift 1 ms/s."""
        offset_s = now_s - said_s
        if self.offset_s is None:
            self.offset_s = offset_s
        self.offset_s = min(self.offset_s + 0.001 * (now_s - self.heard_s), offset_s)
        return offset_s - self.offset_s

    def say(self, message: Dict[str, Any]) -> None:
        """Put a message into the outbox; small ones never pile up, they are asked for."""
        self.outbox += pack_json(message)

    def flush(self) -> None:
        """Send what the line takes without waiting."""
        if self.outbox:
            try:
                sent = self.line.send(self.outbox)
            except BlockingIOError:
                return
            self.outbox = self.outbox[sent:]


class Agent:
    """Serves one controller at a time on one thread; nothing in it ever waits for the network."""

    def __init__(self, listener: socket.socket, secret: str, root: str = "/") -> None:
        listener.setblocking(False)
        self._listener = listener
        self._secret = secret
        self._root = root
        self._callers = []  # type: List[Caller]
        self._controller = None  # type: Optional[Caller]
        self._body = None  # type: Optional[Body]
        self._eye = None  # type: Optional[Eye]
        self._commanded_s = None  # type: Optional[float]
        self._told_s = 0.0
        self._told_fault = None  # type: Optional[str]
        self._frame_id = 0
        self._frame_free = True
        self._newest = None  # type: Optional[VideoFrame]

    def serve_forever(self) -> None:
        """Serve until interrupted; the motors stand whenever this ends."""
        try:
            while True:
                self.turn()
        finally:
            self._release_controller()

    def turn(self) -> None:
        """Wait at most 50 ms for something to do, and do it."""
        readers = [self._listener] + [caller.line for caller in self._callers]  # type: List[Any]
        if self._eye is not None and self._eye.video is not None:
            readers.append(self._eye.video)
        writers = [caller.line for caller in self._callers if caller.outbox]
        readable, writable, _ = select.select(readers, writers, [], 0.05)
        now_s = time.monotonic()
        if self._listener in readable:
            self._accept(now_s)
        for caller in list(self._callers):
            try:
                if caller.line in readable:
                    self._hear(caller, now_s)
                caller.flush()
            except Exception as error:  # top of the loop: whatever a caller says, go on
                self._drop(caller, "{}: {}".format(type(error).__name__, error))
        self._watch(now_s)
        self._look(now_s)
        self._tell(now_s)

    def _accept(self, now_s: float) -> None:
        line, address = self._listener.accept()
        line.setblocking(False)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
        caller = Caller(line, address[0], now_s)
        self._callers.append(caller)
        caller.say({"hello": PROTOCOL, "nonce": caller.nonce})

    def _hear(self, caller: Caller, now_s: float) -> None:
        data = caller.line.recv(65536)
        if not data:
            raise EOFError("it hung up")
        words = [json.loads(body.decode()) for kind, body in caller.unpacker.feed(data)]
        moves = [word for word in words if word["do"] in ("run", "stop")]
        for word in words:
            if caller is not self._controller:
                self._admit(caller, word)
            elif word["do"] not in ("run", "stop"):
                self._obey(caller, word, now_s)
            elif word is moves[-1]:  # of several that wait, only the last counts
                self._move(caller, word, now_s)
        caller.heard_s = now_s

    def _admit(self, caller: Caller, word: Dict[str, Any]) -> None:
        from hmac import compare_digest

        proof = prove(self._secret, caller.nonce)
        if word["do"] != "join" or not compare_digest(str(word["proof"]), proof):
            self._refuse(caller, "wrong secret")
        elif self._controller is not None:
            self._refuse(caller, "busy: {} has the robot".format(self._controller.name))
        else:
            self._controller = caller
            self._frame_free = True
            caller.say({"welcome": PROTOCOL})
            print("{} has the robot".format(caller.name), flush=True)

    def _refuse(self, caller: Caller, why: str) -> None:
        caller.say({"refused": why})
        caller.flush()
        raise EOFError(why)

    def _obey(self, caller: Caller, word: Dict[str, Any], now_s: float) -> None:
        do = word["do"]
        if do == "ping":
            caller.delay_s(float(word["t"]), now_s)
        elif do == "open":
            self._open_body(caller, word)
        elif do == "close":
            self._close_body()
        elif do == "video":
            self._close_eye()
            self._eye = Eye(
                word["device"], word["width"], word["height"], word["rate"], word["encoding"]
            )
        elif do == "blind":
            self._close_eye()
        elif do == "seen":
            self._frame_free = True
        elif do == "show" and self._body is not None:
            self._body.show(word["mode"], word["address"])
        elif do == "positions" and self._body is not None:
            caller.say({"positions": self._body.positions()})

    def _open_body(self, caller: Caller, word: Dict[str, Any]) -> None:
        self._close_body()
        body = Body(word["left"], word["right"], word["ultrasonic"], word["touch"], self._root)
        try:
            body.open()
        except HardwareError as error:
            caller.say({"failed": str(error)})
            return
        self._body = body
        caller.say({"opened": body.sense()})

    def _move(self, caller: Caller, word: Dict[str, Any], now_s: float) -> None:
        body = self._body
        if body is None:
            return
        late_s = caller.delay_s(float(word["t"]), now_s)
        try:
            if word["do"] == "stop":
                body.stop()
            elif late_s <= STALE_S:
                time_ms = min(int(word["ms"]), int(WATCHDOG_S * 1000))
                body.run(float(word["left"]), float(word["right"]), time_ms)
                self._commanded_s = now_s
        except HardwareError as error:
            caller.say({"fault": str(error)})

    def _watch(self, now_s: float) -> None:
        """Stop the motors, and drop the controller, when it has been silent for too long."""
        if self._commanded_s is not None and now_s - self._commanded_s > WATCHDOG_S:
            self._commanded_s = None
            if self._body is not None:
                self._body.stop()
        for caller in list(self._callers):
            if now_s - caller.heard_s > SILENCE_S:
                self._drop(caller, "it fell silent")

    def _look(self, now_s: float) -> None:
        """Send the newest picture if the last one has arrived; older ones are dropped."""
        if self._eye is None or self._controller is None:
            return
        self._newest = self._eye.look(now_s) or self._newest
        video = self._eye.video
        if self._newest is None or video is None or not self._frame_free:
            return
        self._frame_id += 1
        head = PICTURE.pack(
            self._frame_id,
            self._newest.taken_s,
            video.width,
            video.height,
            ENCODINGS.index(video.encoding),
        )
        body = head + self._newest.data
        self._controller.outbox += HEAD.pack(b"F", len(body)) + body
        self._frame_free, self._newest = False, None
        self._told_fault = None

    def _tell(self, now_s: float) -> None:
        """Tell the controller of sensors, buttons and faults, ten times a second."""
        caller = self._controller
        if caller is None or now_s - self._told_s < 0.1 or len(caller.outbox) > 65536:
            return
        self._told_s = now_s
        message = {"t": now_s}  # type: Dict[str, Any]
        if self._body is not None:
            try:
                message.update(sensors=self._body.sense(), button=self._body.take_button())
            except HardwareError as error:
                message.update(fault=str(error))
        if self._eye is not None:
            message.update(camera_fault=self._eye.fault)
        caller.say(message)

    def _drop(self, caller: Caller, why: str) -> None:
        print("{} left: {}".format(caller.name, why), flush=True)
        self._callers.remove(caller)
        caller.line.close()
        if caller is self._controller:
            self._release_controller()

    def _release_controller(self) -> None:
        self._controller = None
        self._close_body()
        self._close_eye()

    def _close_body(self) -> None:
        self._commanded_s = None
        if self._body is not None:
            self._body.close()
            self._body = None

    def _close_eye(self) -> None:
        self._newest = None
        if self._eye is not None:
            self._eye.close()
            self._eye = None


def read_secret(path: str) -> str:
    """Read the shared secret from a file that only its owner may read."""
    if stat.S_IMODE(os.stat(path).st_mode) & 0o077:
        raise SystemExit("agent: others can read {}; say: chmod 600 {}".format(path, path))
    with open(path) as file:
        secret = file.read().strip()
    if len(secret) < 8:
        raise SystemExit("agent: the secret in {} is shorter than 8 characters".format(path))
    return secret


def main() -> None:
    """Start the agent."""
    parser = argparse.ArgumentParser(description="Lend this brick to a Drivelesson server.")
    parser.add_argument("--host", default="0.0.0.0", help="address to listen on")
    parser.add_argument("--port", type=int, default=PORT, help="port to listen on")
    parser.add_argument("--secret-file", required=True, help="file with the shared secret")
    parser.add_argument("--root", default="/", help="folder with the brick's sys and dev")
    args = parser.parse_args()
    secret = read_secret(args.secret_file)
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((args.host, args.port))
    except OSError as error:
        raise SystemExit(
            "agent: port {} is taken ({}); is another agent running?".format(
                args.port, error.strerror
            )
        ) from None
    listener.listen(4)
    print("listening on port {}".format(listener.getsockname()[1]), flush=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        Agent(listener, secret, args.root).serve_forever()
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
