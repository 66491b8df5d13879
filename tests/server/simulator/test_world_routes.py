"""A client gets the robot's path in parts, over HTTP."""

from typing import Any

import httpx
import pytest

from robot.driver import Pose, Sensors
from tests.server.virtual_server import VirtualServer


def path_of(server: VirtualServer, since: object = 0) -> httpx.Response:
    return httpx.get(f"{server.address}/api/path", params={"since": str(since)})


def test_the_path_is_sent_in_parts_with_its_driver(server):
    known: list[Any] = []
    for step in range(1, 5):
        server.rig.driver.sensors = Sensors(pose=Pose(x_m=step, y_m=0.5, heading_rad=0.1))
        server.wait_until(lambda now=step: len(path_of(server).json()["pose"]) >= now)
        part = path_of(server, len(known)).json()
        assert part["first"] == len(known)
        assert (len(part["driven_by"]), part["is_estimate"]) == (len(part["pose"]), False)
        known += part["pose"]
    assert [pose[0] for pose in known] == [1, 2, 3, 4]
    again = path_of(server, len(known)).json()
    assert (again["first"], again["pose"]) == (len(known), [])
    for strange in (999, -5):
        whole = path_of(server, strange).json()
        assert (whole["first"], whole["pose"]) == (0, known)


def test_an_estimated_path_is_marked_as_an_estimate(server):
    pose = Pose(x_m=1.0, y_m=0.5, heading_rad=0.1, is_estimate=True)
    server.rig.driver.sensors = Sensors(pose=pose)
    server.wait_until(lambda: path_of(server).json()["is_estimate"])
    with server.pilot() as pilot:
        pilot.wait_for(
            lambda m: (
                m.get("pose") == {"x_m": 1.0, "y_m": 0.5, "heading_rad": 0.1, "is_estimate": True}
            )
        )


def test_a_robot_that_does_not_know_its_place_has_no_path(server):
    server.wait_until(lambda: server.rig.loop.state.frame_id is not None)
    answer = path_of(server).json()
    assert (answer["first"], answer["pose"], answer["events"]) == (0, [], {})
    assert httpx.get(f"{server.address}/api/world").json() == {"world": None, "worlds": []}


@pytest.mark.parametrize("since", ["x", "1e3", ""])
def test_an_invalid_number_is_refused(server, since):
    assert path_of(server, since).status_code in (400, 422)


def test_no_real_robot_is_carried_elsewhere(server):
    url = f"{server.address}/api/world"
    refused = httpx.put(url, json={"name": "box"})
    assert (refused.status_code, "simulated" in refused.json()["detail"]) == (409, True)
    for body in ({}, {"name": 3}, {"name": "x" * 999}, []):
        assert httpx.put(url, json=body).status_code == 400, body
