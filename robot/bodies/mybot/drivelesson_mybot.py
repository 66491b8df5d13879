"""The robot mybot, driven over HTTP: /move?name=fast&ms=400&speed=1.0, /stop and /sense."""

import json
from contextlib import suppress
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from typing import Any

from robot.driver import ACTION_TIMEOUT_S, Driver, Move
from robot.errors import DriveError, NotConnectedError
from robot.types import Action, Sensors


@dataclass(frozen=True, kw_only=True)
class MybotOptions:
    """Each field becomes a flag of the command line."""

    mybot_address: str = field(default="192.168.4.1:80", metadata={"help": "its HOST:PORT"})


class MybotDriver(Driver):
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

    def __init__(self, options: MybotOptions) -> None:
        self._address = options.mybot_address
        self._line: HTTPConnection | None = None

    @property
    def is_connected(self) -> bool:
        return self._line is not None

    def connect(self) -> None:
        self._line = self._line or HTTPConnection(self._address, timeout=0.5)
        self.stop()

    def disconnect(self) -> None:
        with suppress(DriveError):
            self.stop()
        if self._line is not None:
            self._line.close()
        self._line = None

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        self.check_action(action, speed_scale)
        move = f"/move?name={action}&ms={round(1000 * ACTION_TIMEOUT_S)}&speed={speed_scale}"
        self._ask("/stop" if action is Action.STOP else move)
        return action

    def sense(self) -> Sensors:
        return Sensors(distance_m=self._ask("/sense").get("distance_m"))

    def stop(self) -> None:
        if self._line is not None:
            self._ask("/stop")

    def _ask(self, path: str) -> dict[str, Any]:
        if self._line is None:
            raise NotConnectedError("mybot is not connected; call connect() first")
        try:
            self._line.request("GET", path)
            return dict(json.loads(self._line.getresponse().read()))
        except (OSError, HTTPException, ValueError) as error:
            self._line.close()
            raise DriveError(f"mybot at {self._address} does not answer: {error}") from error
