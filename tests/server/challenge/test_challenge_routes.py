"""The challenge works over HTTP, and appears in the recording of its drive and on a class's
board."""

from pathlib import Path
from typing import Any

import httpx

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.testing import VirtualClock
from robot.types import Mode
from server.recordings.part import Recordings
from tests.server.virtual_server import VirtualServer


def told(server: VirtualServer) -> dict[str, Any]:
    answer: dict[str, Any] = httpx.get(f"{server.address}/api/challenge").json()
    return answer


def test_a_try_is_armed_and_can_be_given_up(server):
    at = f"{server.address}/api/challenge"
    assert not told(server)["is_armed"] and told(server)["best_m"] is None
    assert httpx.post(f"{at}/try").json()["is_armed"]
    assert not httpx.delete(f"{at}/try").json()["is_armed"]
    assert told(server)["tries"] == []
    assert httpx.put(at, json={"is_shown": "yes"}).status_code == 400


def simulated(folder: Path) -> VirtualServer:
    """A simulated robot, which measures its path."""
    clock = VirtualClock(100.0)
    driver = SimDriver(SimOptions(world="office"))
    camera = SimCamera(driver, SimCameraOptions(frame_rate_hz=10.0), clock)
    return VirtualServer(data=folder, rig=Rig(driver, camera, make_policy("default-8"), clock))


def test_the_result_of_a_try_is_recorded_and_shown_on_the_board_on_request(tmp_path):
    with simulated(tmp_path) as server, server.pilot() as pilot:
        pilot.mode("train")
        pilot.wait_for_state(mode="train")
        pilot.hold("forward")
        server.forward(0.6)
        pilot.hold(None)
        httpx.post(f"{server.address}/api/challenge/try")
        pilot.mode("autonomous")
        server.forward(4.0)
        server.set_mode(Mode.STOPPED)
        server.forward(0.5)
        [tried] = told(server)["tries"]
        assert tried["metres"] > 0.2 and tried["ended_by"] == "stopped"
        assert server.services.shown() == {}, "no pilot has agreed to be shown"
        httpx.put(f"{server.address}/api/challenge", json={"is_shown": True})
        best_m = told(server)["best_m"]
        assert server.services.shown() == {"challenge": {"best_m": best_m, "tries": 1}}
        store = server.persistence.part(Recordings).episodes
        server.forward(15.0)
        [name] = store.ids()
        details = httpx.get(f"{server.address}/api/episodes/{name}").json()
    [result] = details["results"]
    assert result["of"] == "challenge" and result["metres"] == tried["metres"]
    assert 0.0 < result["at_s"] <= details["duration_s"] and result["best_m"] == best_m
