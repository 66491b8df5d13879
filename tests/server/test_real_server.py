"""One drive over real sockets and threads: that the parts work, not how fast. See test_drive.py."""

from __future__ import annotations

import time

import httpx
import pytest

from robot.types import Action, Mode

from .live_robot import LiveServer, Pilot, live_server, wait_until

_PATIENCE_S = 60.0


@pytest.mark.realtime
def test_a_pilot_drives_over_real_sockets_and_the_robot_stands_when_it_vanishes() -> None:
    with live_server() as server:
        assert httpx.get(server.address + "/healthz").json()["status"] == "ok"
        with Pilot(server.ws("/ws/drive"), sees=True) as pilot:
            wait_until(lambda: pilot.picture is not None, _PATIENCE_S, "a picture")
            pilot.wait_for_state(_PATIENCE_S, you_are_pilot=True)
            wait_until(lambda: _drives(server, pilot), _PATIENCE_S, "it drives")
            pilot.vanish()
            wait_until(lambda: server.driver.now is Action.STOP, _PATIENCE_S, "it stands")
        with server.pilot() as pilot:
            pilot.socket.send("x" * 70_000)
            pilot._threads[0].join(_PATIENCE_S)
            assert pilot.socket.close_code == 1009, "a huge message closes the connection"
        wait_until(lambda: not server.hub.clients, _PATIENCE_S, "the hub lets it go")


def _drives(server: LiveServer, pilot: Pilot) -> bool:
    """Ask again where a busy machine has made the robot stand, as a person does."""
    if server.rig.loop.mode is Mode.STOPPED:
        pilot.mode("train")
        time.sleep(0.2)
    pilot.held = "forward"
    return server.driver.now is Action.FORWARD
