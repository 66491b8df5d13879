"""Tells people to check the battery if the program has ended several times just as a drive began: a
weak battery can cut off the computer when the motors start."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

from robot.bodies.early_ends import EarlyEnds
from server.services import Extension, Services

log = logging.getLogger(__name__)
FILE = "drive-began.json"


class BatteryExtension(Extension):
    """Records in the data folder that a drive has begun; does nothing without a data folder."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self._services = services
        self._ends: EarlyEnds | None = None

    def start(self) -> None:
        kept, announce = self._services.persistence, self._services.hub.broadcast.announce
        if kept is None:
            return
        ends = EarlyEnds(kept.storage.root / FILE, lambda: announce("battery_bears"))
        if ends.is_weak:
            log.warning("the program ended %d times as a drive began: check battery", ends.count)
            announce("check_battery", detail=str(ends.count))
        self._ends = ends
        ends.start(self._services.robot.loop)

    def stop(self) -> None:
        if self._ends is not None:
            self._ends.close()
