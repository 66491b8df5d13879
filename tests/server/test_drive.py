from __future__ import annotations

import json

import httpx
import pytest

from robot.types import Action, Point
from server.protocol import encode_acknowledgement, parse_picture
from tests.faults.scenario import POINTS
from tests.server.virtual_server import VirtualServer, connect

Points = dict[str, Point]


@pytest.fixture(params=["by moves", "proportional"])
def points(request: pytest.FixtureRequest, server: VirtualServer) -> Points:
    """The steering and throttle of each move, if the pilot steers proportionally."""
    server.driver.takes_points = request.param == "proportional"
    return POINTS if server.driver.takes_points else {}


def test_a_pilot_drives_and_the_robot_stands_when_it_lets_go(
    server: VirtualServer, points: Points
) -> None:
    with server.pilot() as pilot:
        assert pilot.hello["protocol"] == 1
        assert pilot.hello["moves"] == ["forward", "left", "right"]
        pilot.wait_for_state(you_are_pilot=True, mode="stopped")
        pilot.mode("train")
        pilot.wait_for_state(mode="train")
        pilot.hold("forward", points.get("forward"))
        server.wait_until(lambda: server.driver.now is Action.FORWARD)
        pilot.wait_for_state(driven_by="pilot", action="forward")
        assert server.driver.point == points.get("forward")
        pilot.hold(None)
        server.wait_until(lambda: server.driver.now is Action.STOP)
        assert pilot.errors() == []


def test_a_viewer_sees_pictures_but_its_orders_are_refused(server: VirtualServer) -> None:
    with server.pilot() as pilot, server.pilot() as viewer:
        pilot.wait_for_state(you_are_pilot=True, viewers=1)
        viewer.wait_for_state(you_are_pilot=False, pilot=pilot.hello["client"])
        viewer.wait_for(lambda m: m["type"] == "error" and m["code"] == "not_pilot")
        pilot.mode("train")
        viewer.wait_for_state(mode="train")
        viewer.send(type="stop")
        pilot.wait_for_state(emergency=True, stop_reason="emergency")


def test_when_the_pilot_leaves_the_other_client_gets_the_wheel_and_the_robot_stands(
    server: VirtualServer,
    points: Points,
) -> None:
    """A pilot may connect again before the lost connection is closed."""
    with server.pilot() as lost, server.pilot() as back:
        lost.mode("train")
        lost.hold("forward", points.get("forward"))
        server.wait_until(lambda: server.driver.now is Action.FORWARD)
        lost.vanish()
        back.wait_for_state(you_are_pilot=True, mode="stopped")
        assert server.driver.now is Action.STOP, "and nothing is replayed"
        states = [m for m in back.page.messages if m["type"] == "state" and m["you_are_pilot"]]
        assert {state["driven_by"] for state in states} == {"nobody"}, "it has never driven"


def test_the_last_of_several_connections_of_a_page_gets_the_wheel(server: VirtualServer) -> None:
    """After a silence of the network, a page has tried several connections; they close in any
    order, and the page uses the last."""
    with server.pilot() as first, server.pilot() as second, server.pilot() as last:
        first.wait_for_state(you_are_pilot=True)
        first.vanish()
        server.forward(0.1)
        second.vanish()
        last.wait_for_state(you_are_pilot=True)


def test_the_pilot_sees_a_request_for_the_wheel_while_somebody_waits(server: VirtualServer) -> None:
    """Before, the next pilot did not see the request, and nobody saw that the requester left."""
    with server.pilot() as first, server.pilot() as second:
        with server.pilot() as third:
            for asks in (second, third):
                asks.send(type="take")
            first.wait_for_state(you_are_pilot=True, wheel_asked=True)
            first.send(type="yield")
            second.wait_for_state(you_are_pilot=True, wheel_asked=True)
        second.wait_for_state(you_are_pilot=True, wheel_asked=False)


@pytest.mark.parametrize("mode", ["train", "autonomous"])
def test_handing_over_the_wheel_stops_the_robot_before_it_obeys_the_next_pilot(
    server: VirtualServer, points: Points, mode: str
) -> None:
    with server.pilot() as giver, server.pilot() as taker:
        giver.mode(mode)
        giver.wait_for_state(mode=mode)
        giver.hold("left", points.get("left"))
        server.wait_until(lambda: server.driver.now is Action.LEFT)
        taker.send(type="take")
        giver.wait_for(lambda m: m.get("name") == "wheel_asked")
        assert server.driver.now is Action.LEFT, "asking stops nobody"
        giver.send(type="yield")
        taker.hold("forward", points.get("forward"))
        taker.wait_for_state(you_are_pilot=True, mode="stopped")
        server.forward(0.3)
        assert server.driver.now is Action.STOP, "who takes over starts it"
        assert Action.FORWARD not in {action for _, action in server.driver.changes}


def test_refused_messages_are_answered_and_counted(server: VirtualServer) -> None:
    with server.pilot() as pilot:
        pilot.wait_for_state(you_are_pilot=True)
        pilot.is_silent = True
        pilot.hold(None)
        refused = {
            "malformed": "nonsense",
            "too_large": json.dumps({"type": "ping", "client_ms": 1, "x": "y" * 5000}),
            "unknown_type": '{"type":"dance"}',
            "bad_field": '{"type":"drive","held":"up","seq":5000}',
            "out_of_order": '{"type":"drive","held":null,"frame":null,"seq":1}',
            "unknown_frame": '{"type":"drive","held":null,"frame":4000000000,"seq":9000}',
        }
        for code, text in refused.items():
            pilot.socket.send(text)
            pilot.wait_for(lambda m, code=code: m["type"] == "error" and m["code"] == code)
        assert {c.value: n for c, n in server.hub.refused.items()} == dict.fromkeys(refused, 1)


def test_a_frame_is_sent_once_and_only_after_an_acknowledgement(server: VirtualServer) -> None:
    with connect(server.ws("/ws/video"), compression=None) as video:
        first = parse_picture(video.recv(5))
        assert (first.width, first.height) == (160, 120)
        server.forward(0.2)
        ids = [first.frame_id]
        for _ in range(20):
            video.send(encode_acknowledgement(ids[-1]))
            ids.append(parse_picture(video.recv(5)).frame_id)
        assert ids == sorted(set(ids))
        assert ids[1] >= ids[0] + 3, "the newest, not the next"


def test_plain_requests_return_the_robots_activity_and_pictures(server: VirtualServer) -> None:
    """A page needs these requests if the network blocks its websockets."""
    with server.pilot() as pilot, httpx.Client(base_url=server.address) as client:
        assert client.get("/api/state").json()["mode"] == "stopped"
        pilot.mode("train")
        pilot.hold("forward")
        server.wait_until(lambda: server.driver.now is Action.FORWARD)
        told = client.get("/api/state").json()
        assert (told["driven_by"], told["action"], told["is_full"]) == ("pilot", "forward", False)
        answer = client.get("/picture.jpg")
        assert (answer.status_code, answer.content[:2]) == (200, b"\xff\xd8")
