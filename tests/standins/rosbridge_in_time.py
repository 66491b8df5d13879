"""A rosbridge in virtual time, with our watchdog behind it; `rosbridge.py` serves a real socket."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from robot.testing import VirtualClock
from tests.standins.firmware_in_time import Box, RunningProgram
from tests.standins.rclpy_node import WatchdogNode


class WatchedBridge(RunningProgram):
    """A rosbridge with the watchdog behind it, and a base that never stops by itself."""

    trouble = refusal = ""
    where = "rosbridge at robot"
    wheels: tuple[float, float] = (0.0, 0.0)

    def __init__(self, clock: VirtualClock, seed: int) -> None:
        super().__init__(clock, seed)
        self.slowest_s, self.lost_s = 0.05, math.inf
        self._node = WatchdogNode(clock, self._say)
        self._node.start()
        self._threads = [
            clock.start_thread(lambda: self._pass(self.to_board, self._node.take), "to robot"),
            clock.start_thread(lambda: self._pass(self.to_server, self._tell), "to server"),
        ]
        self._on_message: Callable[[str, Any], None] = lambda topic, message: None

    def open(self, *_: Any, on_message: Callable[[str, Any], None], **topics: Any) -> Any:
        """Replaces `open_topics`."""
        self._on_message = on_message
        return self

    @property
    def silent_s(self) -> float:
        return max(0.0, self.clock.now_s() - self.lost_s)

    def publish(self, topic: str, message: Any, *_: Any) -> None:
        """Publish a velocity without a zero afterwards, as if the server was gone."""
        self.send(self.to_board, json.dumps(message).encode())

    def hear(self, topic: str, message: Any) -> None:
        """Publish like another node on the robot."""
        self._node.hear(topic, message)

    def close(self) -> None:
        """There is nothing to close."""

    def lose(self) -> None:
        self.is_lost, self.lost_s = True, min(self.lost_s, self.clock.now_s())

    def regain(self) -> None:
        self.is_lost, self.lost_s = False, math.inf

    def end(self) -> None:
        super().end()
        self._node.end()
        for thread in self._threads:
            thread.join()

    def _say(self, topic: str, kind: str, message: Any) -> None:
        if topic == "/cmd_vel":
            ahead, turn = message["linear"]["x"], message["angular"]["z"]
            self.wheels = ahead - turn, ahead + turn
        else:
            self.send(self.to_server, json.dumps(message).encode())

    def _tell(self, message: Any) -> None:
        self._on_message("/drivelesson/alive", message)

    def _pass(self, box: Box, take: Callable[[Any], None]) -> None:
        while not self._is_over:
            data = box.take(0.1)
            if data is not None:
                take(json.loads(data))
