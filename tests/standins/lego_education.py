"""A double motor behind LEGO's own library, by the transport interface that the library documents.

The library is not a dependency (its licence allows only non-commercial use): CI installs it into
var/legoeducation for these tests.
"""

from __future__ import annotations

import asyncio
import importlib
import struct
import sys
import time
from collections.abc import Awaitable, Callable
from typing import Any, Self

from tests.kit.needed import installed


def find_library() -> Any:
    """Return LEGO's library; skips visibly if it is missing, and fails in CI."""
    folder = str(installed("legoeducation", "legoeducation", "--no-deps "))
    if folder not in sys.path:
        sys.path.append(folder)
    return importlib.import_module("legoeducation")


class FakeDoubleMotor:
    """`told` lists the orders as (direction, percent, milliseconds); `cut` takes it out of range.

    The settings (`end_state`, `acceleration`, `steering`) outlast a program, as in the real motor.
    `others` are further motors in range.
    """

    def __init__(self, address: str = "A4:34:F1:00:00:01") -> None:
        self.library = find_library()
        self.rpc = importlib.import_module("legoeducation.rpc_message")
        self.name, self.address = "Double Motor", address
        self.others: list[FakeDoubleMotor] = []
        self.end_state, self.acceleration, self.steering = 0, (20, 5), 100
        self.search_fails: Exception | None = None
        self.told: list[tuple[int, int, int]] = []
        self.percent, self.ends_s = 0, 0.0
        self.is_in_reach, self.is_pressed = True, False
        self.rpc_version: tuple[int, int, int] = self.rpc.RPC_VERSION
        self._say: Callable[[Any, bytes], Awaitable[None]] | None = None
        self._lost: Callable[[], None] = lambda: None
        self._telling: asyncio.Task[None] | None = None

    def __enter__(self) -> Self:
        seam = importlib.import_module("legoeducation.ble_transport")
        motor = self

        class Transport(seam.BLETransport):
            async def scan_devices(self, timeout: float, filters: Any = None) -> list[Any]:
                if motor.search_fails is not None:
                    raise motor.search_fails
                wanted = (filters or {}).get("device_name") or ""
                all_motors = [motor, *motor.others]
                return [one for one in all_motors if one.is_in_reach and wanted in one.name]

            async def connect(self, device: Any, say: Any, lost: Any) -> bool:
                motor._say, motor._lost = say, lost
                return motor.is_in_reach

            async def send(self, device: Any, message: bytes) -> None:
                if motor.is_in_reach:
                    await motor.obey(bytes(message))

            async def device_disconnect(self, device: Any) -> None:
                motor.hang_up()

            def shutdown_all(self) -> None:
                motor.hang_up()

        self._before = seam._transport_class
        seam.register_transport(Transport)
        self._manager = importlib.import_module("legoeducation.basic_device").my_worker
        self._manager._transport = None
        return self

    def __exit__(self, *error: object) -> None:
        importlib.import_module("legoeducation.ble_transport")._transport_class = self._before
        self._manager._transport = None

    @property
    def is_moving(self) -> bool:
        return time.monotonic() < self.ends_s

    def cut(self) -> None:
        self.is_in_reach = False

    def hang_up(self) -> None:
        if self._telling is not None:
            self._telling.cancel()
        self._telling = None
        self._lost()

    async def obey(self, message: bytes) -> None:
        """Execute the commands of one packet, one after the other."""
        rpc = self.rpc
        while message:
            kind, rest = message[0], message[1:]
            if kind == rpc.INFO_REQUEST:
                size = 0
                answer = rpc.InfoResponse(*self.rpc_version, 1, 0, 0, 1, 0, 0, 244, 513)
            elif kind == rpc.DEVICE_NOTIFICATION_REQUEST:
                size = 2
                (every_ms,) = struct.unpack_from("<H", rest)
                if self._telling is None:
                    self._telling = asyncio.ensure_future(self._tell(every_ms / 1000))
                answer = rpc.DeviceNotificationResponse(0)
            elif kind == rpc.MOVEMENT_SET_SPEED_COMMAND:
                size = 1
                (self.percent,) = struct.unpack_from("<b", rest)
                answer = rpc.MovementSetSpeedResult(0)
            elif kind == rpc.MOVEMENT_SET_END_STATE_COMMAND:
                size = 1
                (self.end_state,) = struct.unpack_from("<b", rest)
                answer = rpc.MovementSetEndStateResult(0)
            elif kind == rpc.MOVEMENT_SET_ACCELERATION_COMMAND:
                size = 2
                self.acceleration = struct.unpack_from("<BB", rest)
                answer = rpc.MovementSetAccelerationResult(0)
            elif kind == rpc.MOVEMENT_SET_TURN_STEERING_COMMAND:
                size = 1
                (self.steering,) = struct.unpack_from("<B", rest)
                answer = rpc.MovementSetTurnSteeringResult(0)
            elif kind == rpc.MOVEMENT_MOVE_FOR_TIME_COMMAND:
                size = 5
                run_ms, direction = struct.unpack_from("<LB", rest)
                self.told.append((direction, self.percent, run_ms))
                self.ends_s = time.monotonic() + run_ms / 1000
                answer = rpc.MovementMoveForTimeResult(0)
            elif kind == rpc.MOVEMENT_STOP_COMMAND:
                size = 0
                self.ends_s = 0.0
                answer = rpc.MovementStopResult(0)
            else:
                raise AssertionError(f"the double motor knows no command {kind}")
            await self._answer(answer)
            message = rest[size:]

    async def _answer(self, answer: Any) -> None:
        if self._say is not None and self.is_in_reach:
            await self._say("characteristic", bytes(answer.Serialize()))

    async def _tell(self, every_s: float) -> None:
        rpc = self.rpc
        while True:
            state = rpc.BUTTON_STATE_PRESSED if self.is_pressed else rpc.BUTTON_STATE_RELEASED
            parts = (rpc.InfoDeviceNotification(80, 0), rpc.ButtonStateNotification(state))
            data = b"".join(bytes(part.Serialize()) for part in parts)
            await self._answer(rpc.DeviceNotification(len(data), data))
            await asyncio.sleep(every_s)
