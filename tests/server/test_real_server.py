"""One drive over real sockets and threads: that the parts work, not how fast. See test_drive.py."""

from __future__ import annotations

import httpx
import pytest

from robot.types import Action

from .live_robot import Pilot, live_server, wait_until

_PATIENCE_S = 30.0


@pytest.mark.realtime
def test_a_pilot_drives_over_real_sockets_and_the_robot_stands_when_it_vanishes() -> None:
    with live_server() as server:
        assert httpx.get(server.address + "/healthz").json()["status"] == "ok"
        with Pilot(server.ws("/ws/drive"), sees=True) as pilot:
            wait_until(lambda: pilot.picture is not None, _PATIENCE_S, "a picture")
            pilot.mode("train")
            pilot.wait_for_state(_PATIENCE_S, mode="train")
            pilot.hold("forward")
            wait_until(lambda: server.driver.now is Action.FORWARD, _PATIENCE_S, "it drives")
            pilot.vanish()
            wait_until(lambda: server.driver.now is Action.STOP, _PATIENCE_S, "it stands")
        wait_until(lambda: not server.hub.pages, _PATIENCE_S, "the hub lets it go")
