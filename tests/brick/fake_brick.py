"""An EV3 made of files, with a thread that plays the kernel's motor driver.

Plain files keep old bytes behind a shorter value, so only the first line of each counts.
"""

from __future__ import annotations

import os
import struct
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

POLL_S = 0.002


@dataclass(frozen=True)
class Command:
    """One command as the kernel got it; `time_ms` is None for a move without an end."""

    at_s: float
    port: str
    command: str
    speed: int
    time_ms: int | None


class FakeMotor:
    def __init__(self, folder: Path, port: str) -> None:
        self.folder, self.port = folder, port
        self.until_s = 0.0
        self.speed = 0
        self.position = 0.0
        self.mark: tuple[int, str] = (0, "")

    def read(self, name: str) -> str:
        return (self.folder / name).read_text().partition("\n")[0]


class FakeBrick:
    """The tree and its kernel thread; a context manager. Motors at outB and outC."""

    def __init__(self, root: Path, *, ports: tuple[str, ...] = ("outB", "outC")) -> None:
        self.root = root
        self.commands: list[Command] = []
        self.motors: dict[str, FakeMotor] = {}
        self._sensors: dict[str, Path] = {}
        self._rounds = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._play_kernel, daemon=True)
        for port in ports:
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
        self._keys = os.open(keys, os.O_RDWR | os.O_NONBLOCK)
        self.screen = root / "dev/tty6"
        self.screen.touch()

    def _make(self, name: str, **attributes: str) -> Path:
        folder = self.root / "sys/class" / name
        folder.mkdir(parents=True, exist_ok=True)
        for attribute, value in attributes.items():
            file = folder / attribute
            file.write_text(value + "\n")
            file.chmod(0o664)  # python-ev3dev2 looks at the group's bits
        return folder

    def add_motor(self, port: str) -> None:
        folder = self._make(
            f"tacho-motor/motor{len(self.motors)}",
            address=f"ev3-ports:{port}",
            driver_name="lego-ev3-l-motor",
            command="",
            count_per_rot="360",
            speed_sp="0",
            time_sp="0",
            stop_action="coast",
            state="",
            position="000000000000",
        )
        self.motors[port] = FakeMotor(folder, port)

    def unplug_motor(self, port: str) -> None:
        """Take a motor out: its files vanish, open ones fail as the kernel's do not (see tests)."""
        motor = self.motors.pop(port)
        motor.folder.rename(self.root / f"unplugged-{port}")

    def add_sensor(self, port: str, driver: str, value: int, decimals: int = 0) -> None:
        self._sensors[driver] = self._make(
            f"lego-sensor/sensor{len(self._sensors)}",
            address=f"ev3-ports:{port}",
            driver_name=driver,
            mode="",
            decimals=str(decimals),
            value0=str(value),
        )

    def set_sensor(self, driver: str, value: int) -> None:
        (self._sensors[driver] / "value0").write_text(f"{value}\n")

    def press(self, code: int) -> None:
        """Press and release a button of the brick."""
        for value in (1, 0):
            os.write(self._keys, struct.pack("@llHHi", 0, 0, 1, code, value))

    def light(self, name: str) -> int:
        return int((self.root / "sys/class/leds" / name / "brightness").read_text().split()[0])

    def is_moving(self) -> bool:
        return any(motor.speed for motor in self.motors.values())

    def speeds(self) -> dict[str, int]:
        return {port: motor.speed for port, motor in self.motors.items()}

    def wait_until(self, is_so: object, timeout_s: float = 3.0) -> float:
        """Wait for a condition (a callable); return how long it took, or fail."""
        assert callable(is_so)
        started_s = time.monotonic()
        while not is_so():
            assert time.monotonic() - started_s < timeout_s, "waited in vain"
            time.sleep(POLL_S)
        return time.monotonic() - started_s

    def catch_up(self) -> None:
        """Wait until the kernel thread has seen all that is written now."""
        seen = self._rounds + 2
        self.wait_until(lambda: self._rounds >= seen)

    def _play_kernel(self) -> None:
        last_s = time.monotonic()
        while not self._ending.wait(POLL_S):
            self._rounds += 1
            now_s = time.monotonic()
            for motor in list(self.motors.values()):
                try:
                    self._turn(motor, now_s, now_s - last_s)
                except FileNotFoundError:
                    continue  # just unplugged
            last_s = now_s

    def _turn(self, motor: FakeMotor, now_s: float, past_s: float) -> None:
        if motor.speed and now_s >= motor.until_s:
            motor.speed = 0
        if motor.speed:
            motor.position += motor.speed * past_s
            with (motor.folder / "position").open("r+b", buffering=0) as file:
                file.write(b"%012d\n" % motor.position)  # one width: never seen half written
        command = motor.read("command")
        mark = ((motor.folder / "command").stat().st_mtime_ns, command)
        if mark == motor.mark:
            return
        motor.mark = mark
        if command:
            self._obey(motor, command, now_s)

    def _obey(self, motor: FakeMotor, command: str, now_s: float) -> None:
        speed, time_ms = int(motor.read("speed_sp")), int(motor.read("time_sp"))
        is_timed = command == "run-timed"
        motor.speed = speed if command.startswith("run") else 0
        motor.until_s = now_s + time_ms / 1000 if is_timed else float("inf")
        self.commands.append(
            Command(now_s, motor.port, command, speed, time_ms if is_timed else None)
        )

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ending.set()
        self._thread.join()
        os.close(self._keys)
