"""Stands in for LEGO's library and a double motor, in virtual time.

Other tests drive LEGO's real library with the simulated motor of `lego_education.py`.
"""

from __future__ import annotations

import logging
import random
from collections import deque
from collections.abc import Callable
from typing import Any
from unittest import mock

from robot.testing import VirtualClock


class DoubleMotor:
    """A double motor with the methods of LEGO's library."""

    BUTTON_STATE_PRESSED = 1
    MOTOR_END_STATE_BRAKE = 1
    logger = logging.getLogger("double motor")

    def __init__(self, clock: VirtualClock, chance: random.Random) -> None:
        self._clock, self._chance = clock, chance
        self._coming: deque[tuple[float, float]] = deque()
        self._noted_s = self._ends_s = 0.0
        self.connected, self.is_lost = False, False
        self.name, self.address = "Double Motor", "AA:BB:CC:DD:EE:01"
        self.info_device = mock.Mock(batteryLevel=80)
        self.button = mock.Mock(state=0)

    def __getattr__(self, name: str) -> object:
        assert name.startswith("MOVEMENT_DIRECTION_"), name
        return name

    def DoubleMotor(self) -> Any:  # noqa: N802 - LEGO's name
        return self

    def search(self, timeout: float, device_name: str | None) -> list[Any]:
        return [self]

    def set_notification_callback(self, note: Callable[[Any], None]) -> None:
        self._note = note

    def connect(self, found: Any, device_notification_delay: int) -> None:
        self.connected = True

    def movement_move_for_time(
        self, ms: int, direction: str, speed: int, *, blocking: bool
    ) -> None:
        self._take(ms / 1000)

    def movement_set_end_state(self, *_: int) -> None:
        """Accept a setting that has no effect here."""

    movement_set_acceleration = movement_set_turn_steering = movement_set_end_state

    def movement_stop(self, *, blocking: bool) -> None:
        self._take(0.0)

    def disconnect(self) -> None:
        self.connected = False

    def _take(self, run_s: float) -> None:
        if not self.is_lost:
            self._coming.append((self._clock.now_s() + self._chance.uniform(0.001, 0.05), run_s))

    def tick(self) -> None:
        now_s = self._clock.now_s()
        while self._coming and self._coming[0][0] <= now_s:
            due_s, run_s = self._coming.popleft()
            self._ends_s = due_s + run_s
        if not self.is_lost and now_s - self._noted_s >= 0.1:
            self._noted_s = now_s
            self._note(None)

    @property
    def is_moving(self) -> bool:
        return self._clock.now_s() < self._ends_s
