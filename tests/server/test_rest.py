"""A standing robot that nobody watches rests, and wakes up at once when a client connects."""

import httpx
import pytest

from robot.devices.rig import Rig
from robot.policy.registry import make_policy
from robot.testing import VirtualClock
from robot.types import Mode
from server.protocol import encode_acknowledgement, parse_picture
from tests.kit.sizes import crossed

from .virtual import Socket
from .virtual_server import VirtualPilot, VirtualServer, connect

pytest.importorskip("panda3d")

from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions

FRESH_S = 0.1


@pytest.fixture(scope="module")
def server():
    clock = VirtualClock(100.0)
    body = SimDriver(SimOptions())
    rig = Rig(body, SimCamera(body, SimCameraOptions(), clock), make_policy("published-8"), clock)
    with VirtualServer(rig=rig) as server:
        yield server


@pytest.fixture
def resting(server):
    server.forward(3.0)
    assert server.rig.loop.state.is_resting
    return server


def spent(server: VirtualServer, seconds: float) -> tuple[int, int]:
    """Return the number of pictures and of ticks within this time."""
    camera, loop = server.rig.camera, server.rig.loop
    pictures, ticks = camera._last_frame_id, loop.state.cycles
    server.forward(seconds)
    return camera._last_frame_id - pictures, loop.state.cycles - ticks


def test_an_unwatched_robot_takes_no_pictures_and_rarely_ticks(resting):
    pictures, ticks = spent(resting, 10.0)
    assert pictures == 0 and ticks <= 50


def test_a_viewer_gets_no_old_picture_and_soon_a_new_one(resting):
    with resting.pilot() as pilot:  # the next state of this page is due when the viewer connects
        pilot.send(type="idle")
        resting.forward(5.0)
        came_s = resting.clock.now_s()
        with connect(resting.ws("/ws/video")) as viewer:
            picture = parse_picture(viewer.recv(FRESH_S))
        assert picture.captured_s >= came_s
        assert resting.clock.now_s() - came_s <= FRESH_S


def test_a_page_that_asks_for_single_pictures_gets_new_ones(resting):
    came_s, latest = resting.clock.now_s(), resting.rig.camera.latest
    with httpx.Client(base_url=resting.address) as page:
        for _ in range(3):
            jpeg, newest = page.get("/picture.jpg").content, latest()
            assert (
                newest is not None and newest.data == jpeg and newest.captured_s >= came_s - FRESH_S
            )
            assert resting.clock.now_s() - came_s <= FRESH_S
            resting.forward(0.5)
            came_s = resting.clock.now_s()


def test_a_viewer_with_one_picture_a_second_costs_one_and_changes_no_rate(resting):
    seen: list[int] = []

    async def begin() -> Socket:
        def acknowledge(message: str | bytes) -> None:
            seen.append(parse_picture(message).frame_id)
            socket.send(encode_acknowledgement(seen[-1]))

        socket = resting.connect("/ws/video?every_ms=1000", acknowledge)
        return socket

    viewer = resting.run(begin())
    resting.forward(1.5)
    pictures, ticks = spent(resting, 10.0)
    assert 9 <= pictures <= 11 and ticks <= 60
    assert resting.rig.loop.state.cycle_hz == pytest.approx(30.0, rel=0.1), "the rate is unchanged"
    # this client makes the robot take all pictures
    with connect(resting.ws("/ws/video")) as another:
        another.recv(FRESH_S)
        before = len(seen)
        assert spent(resting, 3.0)[0] >= 60
        assert 2 <= len(seen) - before <= 4
    viewer.close()


def test_a_page_without_a_picture_leaves_the_robot_at_rest(resting):
    with resting.pilot() as pilot:
        pilot.send(type="idle")
        resting.forward(2.0)
        assert spent(resting, 5.0)[0] == 0
        pilot.send(type="watch")
        assert spent(resting, 1.0)[0] >= 28


@crossed(rested_s=[5.0, 5.013, 5.026, 5.039], sees=[False, True])
def test_a_pilot_starts_at_once_and_the_rest_does_not_count_as_the_cameras_period(
    resting, rested_s, sees
):
    """In an earlier version, the first state arrived up to 150 ms after the pilot."""
    resting.forward(rested_s)
    came_s = resting.clock.now_s()
    with VirtualPilot(resting, sees=sees) as pilot:
        assert pilot.page.state["frame_age_ms"] <= 1000 * FRESH_S
        assert resting.clock.now_s() - came_s <= FRESH_S
        pilot.mode("train")
        pilot.hold("left")
        pilot.wait_for_state(action="left")
        resting.forward(1.0)
        state = resting.rig.loop.state
        assert state.decision.mode is Mode.TRAIN and not state.is_resting
        assert state.camera.period_s == pytest.approx(1 / 30, rel=0.1)
        assert state.camera.speed_scale == 1.0
    assert resting.clock.now_s() - came_s < 5.0
