"""The robot mybot, driven over HTTP: /move?name=fast&ms=400&speed=1.0, /stop and /sense."""

import json
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from typing import Any

from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.errors import told_as
from robot.moves import Move
from robot.types import Action, Point


@dataclass(frozen=True, kw_only=True)
class MybotOptions:
    """Options of mybot; each field becomes a flag of the command line."""

    mybot_address: str = field(default="192.168.4.1:80", metadata={"help": "the robot's HOST:PORT"})


class MybotDriver(ConnectedDriver[HTTPConnection]):
    """Every move contains its time limit, so the robot stops by itself."""

    name = "mybot"
    default_camera = "phone"
    options_type = MybotOptions
    is_remote = True
    declared_moves = (
        Move(Action("fast"), {"en": "Fast", "es": "Rápido", "zh": "快"}, "forward", "drives ahead"),
        Move(Action("slow"), {"en": "Slow", "es": "Lento", "zh": "慢"}, "🐢", "creeps ahead"),
        Move(Action("push"), {"en": "Push", "es": "Empujar", "zh": "推"}, "🦏", "pushes hard"),
    )

    def _open(self) -> HTTPConnection:
        return HTTPConnection(self.options.mybot_address, timeout=0.4)

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        move = f"/move?name={action}&ms={round(1000 * ACTION_TIMEOUT_S)}&speed={speed_scale}"
        self._ask("/stop" if action is Action.STOP else move)

    def _sense(self) -> Sensors:
        return Sensors(distance_m=self._ask("/sense").get("distance_m"))

    def _close(self, connection: HTTPConnection) -> None:
        connection.close()

    def _ask(self, path: str) -> dict[str, Any]:
        line = self._connected()
        # The base class reports an OSError, and opens the connection again.
        with told_as(OSError, self.options.mybot_address, HTTPException, ValueError):
            line.request("GET", path)
            return dict(json.loads(line.getresponse().read()))
