"""Lines to and from the program on a Pybricks hub: its GATT service, by the library `bleak`.

The service is described at github.com/pybricks/technical-info (pybricks-ble-profile.md).
"""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Callable
from typing import Any

from robot.bodies.remote.reconnecting import ReconnectingLink
from robot.clock import Clock
from robot.errors import told_as

SERVICE = "c5f50001-8280-46da-89f4-6d8051e4aeef"
COMMAND_EVENT = "c5f50002-8280-46da-89f4-6d8051e4aeef"
CAPABILITIES = "c5f50003-8280-46da-89f4-6d8051e4aeef"
START_PROGRAM, WRITE_STDIN = 1, 6
STATUS_REPORT, WRITE_STDOUT = 0, 1
PROGRAM_RUNS = 1 << 6
SCAN_S = 8.0
SEND_S = 0.3
"""A write that takes longer has failed; the one under way is never followed by a second."""
_LONGEST_LINE = 200


class HubLine(ReconnectingLink):
    """Lines to and from the program on a hub: the first that is found, or the one of this name.

    `bluetooth` is the module `bleak`, or what has its `BleakScanner` and `BleakClient`.
    """

    def __init__(self, bluetooth: Any, hub: str, clock: Clock) -> None:
        self._bluetooth, self._hub = bluetooth, hub
        self._client: Any = None
        self._runs = True
        self._rest = b""
        self._chunk = 19
        super().__init__("pybricks", clock)

    def send(self, message: bytes) -> None:
        if self._client is None:
            raise ConnectionError(self.trouble)
        if not self._runs:
            raise ConnectionError("its program was ended; its button starts it again")
        self._send_one(self._write(self._client, message)).result(SEND_S)

    # On the thread -----------------------------------------------------------------------------

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        """Find the hub, start its program, and return when the connection is lost."""
        with told_as(ConnectionError, "this computer's Bluetooth is off or missing"):
            device = await self._bluetooth.BleakScanner.find_device_by_filter(
                lambda found, said: (
                    SERVICE in said.service_uuids and self._hub in ("", said.local_name, found.name)
                ),
                timeout=SCAN_S,
                service_uuids=[SERVICE],
            )
        if device is None:
            raise ConnectionError(
                "none in reach says that it has Pybricks; is it on, and not connected elsewhere?"
            )
        lost = asyncio.Event()
        client = self._bluetooth.BleakClient(device, disconnected_callback=lambda _: lost.set())
        async with client:
            most, *_ = struct.unpack_from("<H", await client.read_gatt_char(CAPABILITIES))
            self._chunk, self._rest = max(19, most - 1), b""
            await client.start_notify(COMMAND_EVENT, self._take)
            # A program that runs already makes the hub refuse, which is as good.
            with contextlib.suppress(self._bluetooth.BleakError):
                await client.write_gatt_char(COMMAND_EVENT, bytes([START_PROGRAM]), True)
            self._runs, self._client = True, client
            connected()
            try:
                await lost.wait()
                self.trouble = "the connection was lost"
            finally:
                self._client = None

    async def _write(self, client: Any, message: bytes) -> None:
        line = message + b"\n"
        for start in range(0, len(line), self._chunk):
            part = line[start : start + self._chunk]
            await client.write_gatt_char(COMMAND_EVENT, bytes([WRITE_STDIN]) + part, True)

    def _take(self, _: Any, data: bytearray) -> None:
        """Take an event of the hub: whether its program runs, or what that wrote."""
        if data[:1] == bytes([STATUS_REPORT]) and len(data) >= 5:
            self._runs = bool(struct.unpack_from("<I", data, 1)[0] & PROGRAM_RUNS)
        elif data[:1] == bytes([WRITE_STDOUT]):
            *lines, rest = (self._rest + bytes(data[1:])).split(b"\n")
            self._rest = rest[-_LONGEST_LINE:]
            for line in lines:
                self._take_message(line.strip())
