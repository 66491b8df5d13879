"""Lines to and from the program on a Pybricks hub, over the hub's GATT service, by the library
`bleak`.

The service is described at github.com/pybricks/technical-info (pybricks-ble-profile.md).
"""

from __future__ import annotations

import asyncio
import contextlib
import struct
from collections.abc import Callable
from typing import Any

from robot.bodies.remote.bluetooth import name_trouble
from robot.bodies.remote.reconnecting import ReconnectingLink
from robot.bodies.remote.same_device import Found, SameDevice
from robot.clock import Clock

SERVICE = "c5f50001-8280-46da-89f4-6d8051e4aeef"
COMMAND_EVENT = "c5f50002-8280-46da-89f4-6d8051e4aeef"
CAPABILITIES = "c5f50003-8280-46da-89f4-6d8051e4aeef"
START_PROGRAM, WRITE_STDIN = 1, 6
STATUS_REPORT, WRITE_STDOUT = 0, 1
PROGRAM_RUNS = 1 << 6
SCAN_S = 8.0
TWINS_S = 2.0
"""Time for which the search continues after the first matching hub, to find a second one, in
seconds. A hub advertises itself several times a second."""
SEND_S = 0.3
"""Timeout of a write, in seconds. A second write never begins before the first has ended."""
_LONGEST_LINE = 200


async def find_hub(bluetooth: Any, same: SameDevice, clock: Clock) -> tuple[Found, Any]:
    """Return the wanted hub in range, and bleak's object for it.

    The first search also looks for a second hub that matches; later searches know the hub's
    address.

    Raises:
        ConnectionError: If no hub or several hubs match, or this computer has no Bluetooth.
    """
    seen: dict[str, tuple[Found, Any]] = {}
    since_s: float | None = None

    def note(device: Any, said: Any) -> bool:
        nonlocal since_s
        if SERVICE not in said.service_uuids:
            return False
        hub = Found(said.local_name or device.name or "", device.address)
        seen[hub.address] = (hub, device)
        if not same.may_be(hub):
            return False
        since_s = clock.now_s() if since_s is None else since_s
        n_fit = sum(same.may_be(one) for one, _ in seen.values())
        return same.is_certain(hub) or n_fit > 1 or clock.now_s() - since_s >= TWINS_S

    try:
        await bluetooth.BleakScanner.find_device_by_filter(
            note, timeout=SCAN_S, service_uuids=[SERVICE]
        )
    except Exception as error:  # errors of bleak and of the system have many types
        raise ConnectionError(name_trouble(error) or f"the search failed ({error})") from error
    hubs = [hub for hub, _ in seen.values()]
    chosen = same.pick(hubs)
    if chosen is None:
        none = "" if same.chosen else "no matching hub that runs Pybricks is in range; "
        raise ConnectionError(none + same.name_absent(hubs))
    return seen[chosen.address]


class HubLine(ReconnectingLink):
    """Sends lines to the program on a hub and receives its lines. The hub is the only one in range,
    or the one with a given name.

    `bluetooth` is the module `bleak`, or an object with `BleakScanner` and `BleakClient`. If the
    hub is lost, it is searched for again; no other hub replaces it.
    """

    def __init__(
        self, bluetooth: Any, hub: str, clock: Clock, same: SameDevice | None = None
    ) -> None:
        self._bluetooth = bluetooth
        self._same = same or SameDevice("hub", hub)
        self._client: Any = None
        self._runs = True
        self._rest = b""
        self._chunk = 19
        super().__init__("pybricks", clock)

    def send(self, message: bytes) -> None:
        if self._client is None:
            raise ConnectionError(self.trouble)
        if not self._runs:
            raise ConnectionError(
                "the hub's program has ended; press the hub's button to start it again"
            )
        self._send_one(self._write(self._client, message)).result(SEND_S)

    # On the thread -----------------------------------------------------------------------------

    async def _connect_once(self, connected: Callable[[], None]) -> None:
        """Find the hub, start its program, and return when the connection is lost."""
        hub, device = await find_hub(self._bluetooth, self._same, self._clock)
        lost = asyncio.Event()
        client = self._bluetooth.BleakClient(device, disconnected_callback=lambda _: lost.set())
        try:
            await self._talk(client, hub, lost, connected)
        except (self._bluetooth.BleakError, OSError, TimeoutError) as error:
            if (why := name_trouble(error)) is not None:
                raise ConnectionError(why) from error
            told = str(error) or type(error).__name__
            raise ConnectionError(
                f"{hub} did not connect ({told}); is it in range, and not connected elsewhere?"
            ) from error

    async def _talk(
        self, client: Any, hub: Found, lost: asyncio.Event, connected: Callable[[], None]
    ) -> None:
        async with client:
            most, *_ = struct.unpack_from("<H", await client.read_gatt_char(CAPABILITIES))
            self._chunk, self._rest = max(19, most - 1), b""
            await client.start_notify(COMMAND_EVENT, self._take)
            # If the program is already running, the hub refuses the command, which is harmless.
            with contextlib.suppress(self._bluetooth.BleakError):
                await client.write_gatt_char(COMMAND_EVENT, bytes([START_PROGRAM]), True)
            self._same.chosen = self._same.chosen or hub
            self._runs, self._client = True, client
            connected()
            try:
                await lost.wait()
                self.trouble = f"the connection to {hub} was lost"
            finally:
                self._client = None

    async def _write(self, client: Any, message: bytes) -> None:
        line = message + b"\n"
        for start in range(0, len(line), self._chunk):
            part = line[start : start + self._chunk]
            await client.write_gatt_char(COMMAND_EVENT, bytes([WRITE_STDIN]) + part, True)

    def _take(self, _: Any, data: bytearray) -> None:
        """Handle an event of the hub: its program's state, or the program's output."""
        if data[:1] == bytes([STATUS_REPORT]) and len(data) >= 5:
            self._runs = bool(struct.unpack_from("<I", data, 1)[0] & PROGRAM_RUNS)
        elif data[:1] == bytes([WRITE_STDOUT]):
            *lines, rest = (self._rest + bytes(data[1:])).split(b"\n")
            self._rest = rest[-_LONGEST_LINE:]
            for line in lines:
                self._take_message(line.strip())
