"""The robot mybot, driven over HTTP: /move?name=fast&ms=400&speed=1.0, /stop and /sense."""

import json
from contextlib import suppress
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from typing import Any

from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Move
from robot.errors import DriveError
from robot.types import Action, Point, Sensors


@dataclass(frozen=True, kw_only=True)
class MybotOptions:
    """Each field becomes a flag of the command line."""

    mybot_address: str = field(default="192.168.4.1:80", metadata={"help": "its HOST:PORT"})


class MybotDriver(ConnectedDriver[HTTPConnection]):
    """Every move carries its time limit, so the robot stops by itself."""

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
        return HTTPConnection(self.options.mybot_address, timeout=0.5)

    def _begin(self) -> None:
        self._ask("/stop")

    def _close(self, connection: HTTPConnection) -> None:
        connection.close()

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        move = f"/move?name={action}&ms={round(1000 * ACTION_TIMEOUT_S)}&speed={speed_scale}"
        self._ask("/stop" if action is Action.STOP else move)

    def sense(self) -> Sensors:
        return Sensors(distance_m=self._ask("/sense").get("distance_m"))

    def stop(self) -> None:
        if self.is_connected:
            with suppress(DriveError):  # its time limit stops it, and the next move says so
                self._ask("/stop")

    def _ask(self, path: str) -> dict[str, Any]:
        line = self._connected()
        try:
            line.request("GET", path)
            return dict(json.loads(line.getresponse().read()))
        except (OSError, HTTPException, ValueError) as error:
            line.close()
            where = self.options.mybot_address
            raise DriveError(f"mybot at {where} does not answer: {error}") from error
