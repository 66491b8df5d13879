"""Drives the Thymio through its device manager (Thymio Suite), by setting its motors' variables.

The manager answers each request. tdmclient polls for answers only every 0.1 s, and the thread of
its TCP connection neither ends nor reports a lost connection. Therefore this driver has its own
connection, and polls for answers itself. A motor keeps its target until it gets another one.
"""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import tdmclient

from robot.devkit.host_watchdog import HostWatchdog
from robot.devkit.wheels import TwoWheels
from robot.driver import Sensors
from robot.errors import DriveError
from robot.moves import CLASSIC, point_of
from robot.types import Action, Point

FULL = 500
"""The maximum target speed that a motor reaches; values beyond 16 bits would wrap around."""
ANSWER_S = 0.15
FIRST_ANSWER_S = 1.0
_LOOK_EVERY_S = 0.002


@dataclass(frozen=True, kw_only=True)
class ThymioOptions:
    thymio_manager: str = field(
        default="127.0.0.1:8596", metadata={"help": "HOST:PORT of the device manager"}
    )
    thymio_name: str = field(
        default="", metadata={"help": "the Thymio's name, if there are several"}
    )
    thymio_speed: int = field(
        default=200,
        metadata={"help": "the motors' target speed straight ahead", "range": (20, FULL)},
    )


class ManagerLine:
    """A TCP transport for tdmclient without a thread; each packet is preceded by its length."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), timeout=ANSWER_S)
        self._came = bytearray()

    def send_packet(self, packet: bytes) -> None:
        self._socket.sendall(len(packet).to_bytes(4, "little") + packet)

    def receive_packet(self) -> bytes | None:
        """Return the next packet, or None if none is complete; raises OSError if disconnected."""
        while select.select([self._socket], [], [], 0.0)[0]:
            data = self._socket.recv(65_536)
            if not data:
                raise ConnectionResetError("the device manager closed the connection")
            self._came += data
        end = 4 + int.from_bytes(self._came[:4], "little")
        if len(self._came) < max(end, 5):
            return None
        packet = bytes(self._came[4:end])
        del self._came[:end]
        return packet

    def request_shutdown(self) -> None:
        self._socket.close()


class ThymioDriver(HostWatchdog[tdmclient.Client]):
    name = "thymio"
    default_camera = "phone"
    options_type = ThymioOptions
    is_remote = True
    takes_points = True
    acknowledges = True
    declared_moves = tuple(CLASSIC.values())

    def __init__(self, options: ThymioOptions, clock: Any = None) -> None:
        super().__init__(options, clock)
        full = options.thymio_speed
        self._wheels = TwoWheels(ahead=full, back=full, turn=(0.0, full), spin=full / 2)
        self._lock = threading.Lock()  # the client numbers its requests, and two threads send them
        self._node: Any = None

    @property
    def device(self) -> str:
        return str(self._node.props.get("name", "")) if self._node else ""

    def _open(self) -> tdmclient.Client:
        host, _, port = self.options.thymio_manager.rpartition(":")
        return tdmclient.Client(tdm_transport=ManagerLine(host, int(port)))

    def _begin(self) -> None:
        client, name = self._connected(), self.options.thymio_name

        def found() -> list[Any]:
            return [node for node in client.nodes if name in ("", node.props.get("name"))]

        if not self._await(client, found, FIRST_ANSWER_S):
            who = f"Thymio named {name!r}" if name else "Thymio"
            raise DriveError(
                f"the device manager sees no {who}; is it on, and connected by cable or dongle?"
            )
        self._node = found()[0]
        self._ask(self._node.send_lock_node, within_s=FIRST_ANSWER_S)

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        at = point or point_of(action, self.declared_moves) or Point(0.0, 0.0)
        wheels = self._wheels.at(at, most=(FULL, FULL))
        left, right = (max(-FULL, min(FULL, round(wheel * speed_scale))) for wheel in wheels)
        targets = {"motor.left.target": [left], "motor.right.target": [right]}
        self._ask(self._thymio().send_set_variables, targets)

    def _sense(self) -> Sensors:
        self._ask(self._thymio().watch_node, 0)  # check that the manager still answers
        return Sensors()

    def _close(self, connection: tdmclient.Client) -> None:
        node, self._node = self._node, None
        try:
            if node is not None:
                self._ask(node.send_unlock_node, client=connection)
        finally:
            connection.disconnect()

    def _thymio(self) -> Any:
        if self._node is None:  # another thread has noticed a lost connection
            raise DriveError("the connection to the device manager is lost")
        return self._node

    def _ask(
        self,
        send: Callable[..., Any],
        *what: Any,
        within_s: float = ANSWER_S,
        client: tdmclient.Client | None = None,
    ) -> None:
        """Send a request, and wait for its answer; raises TimeoutError or DriveError."""
        answers: list[Any] = []
        with self._lock:
            send(*what, request_id_notify=answers.append)
        if not self._await(client or self._connected(), lambda: answers, within_s):
            raise TimeoutError(f"the device manager did not answer within {within_s} s")
        if answers[0] is not None:
            raise DriveError(
                f"the device manager refused: {answers[0]}; does another program use the Thymio?"
            )

    def _await(self, client: tdmclient.Client, is_so: Callable[[], Any], within_s: float) -> bool:
        end_s = self._clock.now_s() + within_s
        while not is_so():
            if self._clock.now_s() > end_s:
                return False
            with self._lock:
                client.process_waiting_messages()
            self._clock.sleep(_LOOK_EVERY_S)
        return True
