"""A LEGO hub with Pybricks: Debian's micropython runs the hub's program with simulated `pybricks`
modules, and a simulated `bleak` shows the hub's GATT service.

`hub.bluetooth` replaces the module `bleak`.
"""

from __future__ import annotations

import asyncio
import os
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

from robot.bodies.pybricks.driver import PybricksDriver, PybricksOptions
from robot.bodies.pybricks.hub_line import HubLine
from robot.clock import RealClock
from tests.kit.wait import wait_until
from tests.standins.firmware import ROOT, find_micropython

PROGRAM = ROOT / "docs/examples/firmware/hub.py"
_MODULES = Path(__file__).parent / "hub_modules"
_SERVICE = "c5f50001-8280-46da-89f4-6d8051e4aeef"
_COMMAND_EVENT = "c5f50002-8280-46da-89f4-6d8051e4aeef"
_CAPABILITIES = "c5f50003-8280-46da-89f4-6d8051e4aeef"
_OTHERS = {  # for third-party clients: firmware, protocol, PnP id (SPIKE Prime)
    "00002a26-0000-1000-8000-00805f9b34fb": b"3.6.1",
    "00002a28-0000-1000-8000-00805f9b34fb": b"1.3.0",
    "00002a50-0000-1000-8000-00805f9b34fb": struct.pack("<BHHH", 1, 0x0397, 0x81, 0),
}
MOST_BYTES = 20
"""The smallest limit of bytes that a hub may have for one write."""
LOST_AFTER_S = 1.0
"""Time after which Bluetooth drops the connection to a hub that is out of range."""


class FakeHub:
    """`ends_s` has the time at which the firmware ends each motor's last order.

    `others` are further hubs in range.
    """

    def __init__(self, name: str = "Pybricks Hub", address: str = "00:16:53:00:00:01") -> None:
        self.name, self.address = name, address
        self.others: list[FakeHub] = []
        self.ends_s: dict[str, float] = {}
        self.told: list[tuple[str, float, int]] = []
        self.reports: list[bytes] = []
        self.light = ""
        self.is_in_reach = True
        self.clients: list[_Client] = []
        self.process: subprocess.Popen[bytes] | None = None
        self.bluetooth = SimpleNamespace(
            BleakScanner=SimpleNamespace(find_device_by_filter=self._find),
            BleakClient=self._make_client,
            BleakError=BleakError,
        )

    def __enter__(self) -> Self:
        find_micropython()
        return self

    def __exit__(self, *error: object) -> None:
        self.end_program()

    @property
    def is_moving(self) -> bool:
        return any(time.monotonic() < end_s for end_s in self.ends_s.values())

    def driver(self, options: PybricksOptions) -> PybricksDriver:
        """Return a driver that reaches this hub."""
        driver = PybricksDriver(options)
        driver._open_line = lambda: HubLine(self.bluetooth, options.hub, RealClock(), driver._same)
        return driver

    # A person's actions on the hub ---------------------------------------------------------------

    def start_program(self) -> None:
        """Start the program, and wait until it runs; on a real hub, it runs at once."""
        self.light = ""
        self.process = subprocess.Popen(
            [find_micropython(), str(PROGRAM)],
            env={**os.environ, "MICROPYPATH": str(_MODULES)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._reader = threading.Thread(target=self._read, args=(self.process,), daemon=True)
        self._reader.start()
        wait_until(lambda: self.light, "the program sets the light when it begins")
        self.report_status()

    def end_program(self) -> None:
        """End the program, like the hub's button; the firmware then stops the motors."""
        process, self.process = self.process, None
        if process is not None:
            with process:
                process.kill()
                self._reader.join()
            self.ends_s.clear()
            self.report_status()

    def send_signal(self, how: signal.Signals) -> None:
        """Make the hub's program hang or continue, while its firmware runs on."""
        assert self.process is not None
        self.process.send_signal(how)

    def cut(self) -> None:
        """Take the hub out of range: nothing arrives any more, and after a while both sides notice
        that."""
        self.is_in_reach = False
        for client in list(self.clients):
            client.call(client.lose, LOST_AFTER_S)

    # The firmware ------------------------------------------------------------------------------

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith(b"\x01motor"):
                _, port, speed, run_ms = line.decode().split()
                self.told.append((port, float(speed), int(run_ms)))
                self.ends_s[port] = time.monotonic() + int(run_ms) / 1000
            elif line.startswith(b"\x01light"):
                self.light = line.split()[1].decode()
            else:
                self.reports.append(line)
                self._notify(b"\x01" + line.rstrip(b"\n") + b"\r\n")

    def _notify(self, data: bytes) -> None:
        for client in list(self.clients):
            client.notify_soon(data)

    def report_status(self) -> None:
        self._notify(b"\x00" + struct.pack("<I", (1 << 6) * (self.process is not None)))

    def type(self, data: bytes) -> None:
        """Write a line to the standard input of the program."""
        if self.process is not None and self.process.stdin is not None:
            self.process.stdin.write(data)
            self.process.stdin.flush()

    def obey(self, data: bytes) -> None:
        """Receive a write to the characteristic; raises BleakError if the hub refuses it."""
        kind = data[:1]
        if len(data) > MOST_BYTES or kind not in (b"\x00", b"\x01", b"\x06"):
            raise BleakError("Invalid Attribute Length, or invalid command")
        if kind == b"\x06":
            self.type(data[1:])
        elif kind == b"\x00":
            self.end_program()
        elif self.process is not None:
            raise BleakError("Unlikely Error: busy")
        else:
            self.start_program()

    def _make_client(self, device: Any, disconnected_callback: Any = None, **_: Any) -> _Client:
        return _Client(getattr(device, "hub", self), disconnected_callback)

    async def _find(self, matches: Any, timeout: float, **_: Any) -> Any:
        """Like `BleakScanner.find_device_by_filter`, but gives up at once."""
        for hub in (self, *self.others):
            found = SimpleNamespace(name=hub.name, address=hub.address, hub=hub)
            said = SimpleNamespace(service_uuids=[_SERVICE], local_name=hub.name)
            if hub.is_in_reach and not hub.clients and matches(found, said):
                return found
        return None


class BleakError(Exception):
    """Replaces the class of the same name in bleak."""


class _Client:
    """Like `BleakClient`, on the caller's event loop."""

    def __init__(self, hub: FakeHub, on_lost: Any) -> None:
        self._hub, self._on_lost = hub, on_lost
        self._notify: Any = None
        self._is_lost = False

    async def connect(self) -> None:
        if not self._hub.is_in_reach or self._hub.clients:
            raise BleakError("failed to connect")
        self._loop = asyncio.get_running_loop()
        self._hub.clients.append(self)

    async def disconnect(self, *error: object) -> None:
        self._hang_up()

    def _hang_up(self) -> None:
        if self in self._hub.clients:
            self._hub.clients.remove(self)
            if self._on_lost is not None:
                self._on_lost(self)

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    __aexit__ = disconnect

    async def read_gatt_char(self, uuid: str) -> bytes:
        await self._pass()
        capabilities = struct.pack("<HII", MOST_BYTES, 6, 1 << 17)
        return capabilities if uuid == _CAPABILITIES else _OTHERS[uuid]

    async def start_notify(self, uuid: str, callback: Any) -> None:
        await self._pass()
        if uuid == _COMMAND_EVENT:
            self._notify = callback
            self._hub.report_status()

    async def write_gatt_char(self, uuid: str, data: bytes, response: bool = False) -> None:
        await self._pass()
        assert uuid == _COMMAND_EVENT
        self._hub.obey(bytes(data))

    async def _pass(self) -> None:
        """Wait while the hub is out of range."""
        while not self._hub.is_in_reach:
            if self._is_lost:
                raise BleakError("Not connected")
            await asyncio.sleep(0.01)

    def call(self, what: Callable[[], object], after_s: float = 0.0) -> None:
        """Call a function on the client's event loop, from another thread."""
        self._loop.call_soon_threadsafe(self._loop.call_later, after_s, what)

    def notify_soon(self, data: bytes) -> None:
        """Send an event from another thread; a long one in several parts."""
        if self._hub.is_in_reach and self._notify is not None:
            for start in range(1, max(2, len(data)), MOST_BYTES - 1):
                part = bytearray(data[:1] + data[start : start + MOST_BYTES - 1])
                self._loop.call_soon_threadsafe(self._notify, None, part)

    def lose(self) -> None:
        self._is_lost = True
        self._hang_up()
