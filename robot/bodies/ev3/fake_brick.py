"""A simulated EV3 for tests: its devices are plain files, and a thread simulates the kernel's motor
driver.

A plain file still contains old bytes after a shorter value was written, so only the first line of
each file counts. A file cannot refuse a write with EINVAL as the kernel does. If the kernel would
refuse a command, the thread adds it to `refused` instead, and nothing moves.
"""

from __future__ import annotations

import os
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from robot.clock import Clock, RealClock, Worker
from robot.types import StartStop

POLL_S = 0.002
_SEEN_NS = 0
"""When the fake brick reads a command file, it sets the file's modification time to this value. A
file with any other modification time contains a new command. The brick does not compare two
modification times, because two successive commands may have the same."""
MAX_SPEED = 1050
"""Maximum speed of a large motor, in counts a second. The kernel refuses a higher speed."""
DEFAULTS = {
    "polarity": "normal",
    "ramp_up_sp": "0",
    "ramp_down_sp": "0",
    "speed_sp": "0",
    "time_sp": "0",
    "stop_action": "coast",
}
"""The attributes of a motor after `reset`."""
LEFTOVERS = {
    "polarity": "inversed",
    "ramp_up_sp": "2000",
    "ramp_down_sp": "3000",
    "speed_sp": "333",
    "time_sp": "7000",
    "stop_action": "hold",
}
"""Attributes of the fake motors at the start, as another program may leave them on a real brick."""


@dataclass(frozen=True)
class Command:
    """One command as the kernel received it; `time_ms` is None for a move without an end."""

    at_s: float
    port: str
    command: str
    speed: int
    time_ms: int | None


class FakeMotor:
    """One motor: its folder, and its simulated wheel."""

    def __init__(self, folder: Path, port: str) -> None:
        self.folder, self.port = folder, port
        self.command = folder / "command"  # the kernel thread reads these files repeatedly
        self.until_s = 0.0
        self.speed = 0
        self.position = 123456.0
        self.is_stalled = False
        self.kept: set[str] = set()
        """Attributes that another program sets again after each reset."""

    def read(self, name: str) -> str:
        return (self.folder / name).read_text().partition("\n")[0]

    def write(self, name: str, value: str) -> None:
        """Set an attribute in place, because readers hold the file open."""
        file = os.open(f"{self.folder}/{name}", os.O_WRONLY)
        try:
            os.write(file, value.encode() + b"\n")
        finally:
            os.close(file)


class FakeBrick(StartStop):
    """The simulated brick: its files, and the thread that simulates the kernel. A context manager.
    Its motors are at outB and outC.

    Both motors begin with the settings of another program. With a virtual `clock`, only code that
    waits by the same clock can use the brick; an agent in a separate process needs the real clock.
    """

    def __init__(self, root: Path, *, clock: Clock | None = None) -> None:
        self.root = root
        self.clock = clock or RealClock()
        self.commands: list[Command] = []
        self.refused: list[Command] = []
        self.motors: dict[str, FakeMotor] = {}
        self._sensors: dict[str, Path] = {}
        self._rounds = 0
        self._ending = threading.Event()
        self._thread: Worker | None = None
        for port in ("outB", "outC"):
            self.add_motor(port)
        self._make(
            "power_supply/lego-ev3-battery",
            voltage_now="7250000",
            voltage_min_design="6500000",
            voltage_max_design="8000000",
        )
        for side in (0, 1):
            for colour in ("red", "green"):
                self._make(
                    f"leds/led{side}:{colour}:brick-status", max_brightness="255", brightness="0"
                )
        keys = root / "dev/input/by-path/platform-gpio_keys-event"
        keys.parent.mkdir(parents=True)
        os.mkfifo(keys)
        self._keys: int | None = os.open(keys, os.O_RDWR | os.O_NONBLOCK)
        self.screen = root / "dev/tty6"
        self.screen.touch()
        (root / "proc").mkdir()
        (root / "proc/meminfo").write_text("MemTotal:  57620 kB\nMemAvailable:  33800 kB\n")

    def _make(self, name: str, **attributes: str) -> Path:
        folder = self.root / "sys/class" / name
        folder.mkdir(parents=True, exist_ok=True)
        for attribute, value in attributes.items():
            file = folder / attribute
            file.write_text(value + "\n")
            file.chmod(0o664)  # python-ev3dev2 checks the group's permission bits
        return folder

    def add_motor(self, port: str) -> None:
        folder = self._make(
            f"tacho-motor/motor{len(self.motors)}",
            address=f"ev3-ports:{port}",
            driver_name="lego-ev3-l-motor",
            command="",
            count_per_rot="360",
            max_speed=str(MAX_SPEED),
            state="",
            position="000000123456",
            **LEFTOVERS,
        )
        self.motors[port] = FakeMotor(folder, port)

    def unplug_motor(self, port: str) -> None:
        """Unplug a motor: its files vanish."""
        motor = self.motors.pop(port)
        motor.folder.rename(self.root / f"unplugged-{port}")

    def add_sensor(self, port: str, driver: str, value: int, decimals: int = 0) -> None:
        """Plug in a sensor, perhaps while a driver uses the brick."""
        self._sensors[port] = self._make(
            f"lego-sensor/sensor{len(self._sensors)}",
            address=f"ev3-ports:{port}",
            driver_name=driver,
            mode="",
            decimals=str(decimals),
            value0=str(value),
        )

    def set_sensor(self, port: str, value: int) -> None:
        (self._sensors[port] / "value0").write_text(f"{value}\n")

    def set_battery(self, volts: float) -> None:
        """Set the battery's voltage: 8 if full, 6.5 if empty."""
        battery = self.root / "sys/class/power_supply/lego-ev3-battery/voltage_now"
        battery.write_text(f"{volts * 1e6:.0f}\n")

    def press(self, code: int, for_s: float = 0.1) -> None:
        assert self._keys is not None, "the brick was stopped"
        for value, at_s in ((1, 1000.0), (0, 1000.0 + for_s)):
            second, micro = int(at_s), round(at_s % 1 * 1e6)
            os.write(self._keys, struct.pack("@llHHi", second, micro, 1, code, value))

    def light(self, name: str) -> int:
        return int((self.root / "sys/class/leds" / name / "brightness").read_text().split()[0])

    def is_moving(self) -> bool:
        return any(motor.speed for motor in self.motors.values())

    def speeds(self) -> dict[str, int]:
        return {port: motor.speed for port, motor in self.motors.items()}

    def wait_until(self, is_so: Callable[[], bool], timeout_s: float = 3.0) -> float:
        """Wait until `is_so` returns True, and return how many seconds this took. Fails after
        `timeout_s`."""
        started_s = self.clock.now_s()
        while not is_so():
            assert self.clock.now_s() - started_s <= timeout_s, "timed out waiting"
            self.clock.sleep(POLL_S)
        return self.clock.now_s() - started_s

    def catch_up(self) -> None:
        """Wait until the simulated kernel has read all files that were written so far."""
        seen = self._rounds + 2
        self.wait_until(lambda: self._rounds >= seen, 60.0)

    def _play_kernel(self) -> None:
        last_s = self.clock.now_s()
        while not self.clock.wait(self._ending, POLL_S):
            self._rounds += 1
            now_s = self.clock.now_s()
            for motor in list(self.motors.values()):
                try:
                    self._turn(motor, now_s, now_s - last_s)
                except FileNotFoundError:
                    continue  # the motor was just unplugged
            last_s = now_s

    def _turn(self, motor: FakeMotor, now_s: float, past_s: float) -> None:
        if motor.speed and now_s >= motor.until_s:
            motor.speed = 0
            motor.write("state", "")
        if motor.speed and not motor.is_stalled:
            motor.position += motor.speed * past_s
            # The number has a fixed width, so that no reader sees a half-written number.
            motor.write("position", f"{motor.position:012.0f}")
        if motor.command.stat().st_mtime_ns == _SEEN_NS:
            return
        # Mark the file before reading it, so that a command written from now on is noticed.
        os.utime(motor.command, ns=(_SEEN_NS, _SEEN_NS))
        if command := motor.read("command"):
            self._obey(motor, command, now_s)

    def _obey(self, motor: FakeMotor, command: str, now_s: float) -> None:
        speed, time_ms = int(motor.read("speed_sp")), int(motor.read("time_sp"))
        is_timed = command == "run-timed"
        said = Command(now_s, motor.port, command, speed, time_ms if is_timed else None)
        if abs(speed) > MAX_SPEED:
            self.refused.append(said)
            return
        self.commands.append(said)
        if command == "reset":
            self._reset(motor)
            return
        ramp_s = int(motor.read("ramp_down_sp")) / 1000
        if command.startswith("run"):
            sign = -1 if motor.read("polarity") == "inversed" else 1
            motor.speed = sign * speed
            motor.until_s = now_s + time_ms / 1000 if is_timed else float("inf")
        elif motor.speed and ramp_s:  # the wheel slows down gradually, like a real motor
            motor.until_s = now_s + ramp_s
        else:
            motor.speed = 0
        running = "running stalled" if motor.is_stalled else "running"
        motor.write("state", running if motor.speed else "")

    def _reset(self, motor: FakeMotor) -> None:
        motor.speed, motor.position = 0, 0.0
        motor.write("state", "")
        for name, value in DEFAULTS.items():
            if name not in motor.kept:
                motor.write(name, value)
        # Write the position last: a reader that finds it must also find all other files.
        motor.write("position", "000000000000")

    def start(self) -> None:
        if self._thread is None:
            self._thread = self.clock.start_thread(self._play_kernel, "fake-brick")

    def stop(self) -> None:
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
        if self._keys is not None:
            os.close(self._keys)
            self._keys = None
