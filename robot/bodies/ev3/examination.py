"""Measures a brick through its agent, for `drivelesson brick doctor`."""

from __future__ import annotations

from collections.abc import Callable

from robot.bodies.ev3.archive import release
from robot.bodies.ev3.doctor import BrickFacts, WheelTurn
from robot.bodies.ev3.driver import ChassisOptions
from robot.bodies.ev3.link import BrickLink, RemotePicture
from robot.bodies.ev3.remote_driver import RemoteBody
from robot.driver import ACTION_TIMEOUT_S
from robot.errors import DriveError

ROUND_TRIPS = 20
PICTURES_S = 5.0
WHEEL_TEST = ((1, 0), (0, 1), (1, 1), (-1, -1))
"""Directions of the left and right wheel in each part of the wheel test. A part takes 2.5 s."""
WHEEL_PART_S = 2.5
ROLL_OUT_S = 0.3
WHEEL_DPS = 180.0
OPTIONS = ChassisOptions()
"""The robot that the doctor expects, as `docs/howto/ev3.md` describes it."""


def measure(link: BrickLink, may_turn_wheels: Callable[[], bool]) -> BrickFacts:
    """Return all measurements of a remote brick; raises DriveError if the connection is lost.

    One of the measurements turns the wheels. Before this measurement, `may_turn_wheels` is called
    to ask the user for permission.
    """
    link.hold("doctor", "ping")
    try:
        link.send("inspect")
        inspected = link.answer("inspected")
        ahead_s = float(inspected["clock_s"]) - link.clock.wall_s()
        round_trips_s = [_round_trip_s(link, index) for index in range(ROUND_TRIPS)]
        pictures, camera_fault = _take_pictures(link) if inspected["cameras"] else ([], None)
        body_fault, wheels = _try_wheels(link, may_turn_wheels)
    finally:
        link.release("doctor")
    return BrickFacts(
        address=link.address,
        ports=(OPTIONS.left_port, OPTIONS.right_port),
        release=release(),
        inspected=inspected,
        round_trips_s=round_trips_s,
        clock_ahead_s=ahead_s,
        body_fault=body_fault,
        pictures=pictures,
        camera_fault=camera_fault,
        wheels=wheels,
    )


def _round_trip_s(link: BrickLink, index: int) -> float:
    sent_s = link.clock.now_s()
    link.send("ping", id=index)
    while link.answer("pong") != index:
        pass
    return link.clock.now_s() - sent_s


def _take_pictures(link: BrickLink) -> tuple[list[RemotePicture], str | None]:
    """Take pictures for a while; return them, and the camera fault that the agent reports."""
    pictures: list[RemotePicture] = []
    link.on_picture = pictures.append
    link.send("video", device="auto", width=160, height=120, rate=30, encoding="auto")
    link.clock.sleep(PICTURES_S)
    fault = link.report.get("camera_fault")
    link.send("blind")
    link.on_picture = None
    return pictures, fault


def _try_wheels(
    link: BrickLink, may_turn_wheels: Callable[[], bool]
) -> tuple[str | None, list[WheelTurn] | None]:
    body = RemoteBody(link, OPTIONS.ports())
    try:
        body.open()
        if not may_turn_wheels():
            return None, None
        return None, [_turn(link, body, part) for part in WHEEL_TEST]
    except DriveError as error:
        return str(error), None
    finally:
        body.close()


def _turn(link: BrickLink, body: RemoteBody, part: tuple[int, int]) -> WheelTurn:
    """Turn the wheels for one part of the test. The moves are short, so the wheels stop if this
    program ends."""
    clock, stalled = link.clock, [False, False]
    asked_dps = [way * WHEEL_DPS for way in part]
    before, began_s = body.positions(), clock.now_s()
    try:
        while clock.now_s() - began_s < WHEEL_PART_S:
            body.run(asked_dps[0], asked_dps[1], round(1000 * ACTION_TIMEOUT_S))
            clock.sleep(ACTION_TIMEOUT_S / 4)
            link.send("states")
            for index, state in enumerate(link.answer("states")):
                stalled[index] |= "stalled" in state
    finally:
        body.stop()
    lasted_s = clock.now_s() - began_s
    clock.sleep(ROLL_OUT_S)
    turned_dps = [(b - a) / lasted_s for a, b in zip(before, body.positions(), strict=True)]
    return WheelTurn(asked_dps=asked_dps, turned_dps=turned_dps, is_stalled=stalled)
