"""Measures a brick through its agent, for `drivelesson brick doctor`."""

from __future__ import annotations

from collections.abc import Callable

from robot.bodies.ev3.archive import release
from robot.bodies.ev3.chassis import ChassisOptions
from robot.bodies.ev3.doctor import BrickFacts, WheelTurn
from robot.bodies.ev3.link import BrickLink, RemotePicture
from robot.bodies.ev3.remote_driver import RemoteBody
from robot.clock import Clock, RealClock
from robot.driver import ACTION_TIMEOUT_S
from robot.errors import DriveError

ROUND_TRIPS = 20
PICTURES_S = 5.0
WHEEL_TEST = ((1, 0), (0, 1), (1, 1), (-1, -1))
"""Which wheel turns which way, part by part; 2.5 s each make ten."""
WHEEL_PART_S = 2.5
ROLL_OUT_S = 0.3
WHEEL_DPS = 180.0


class Examination:
    """One visit; a context manager over the line to the agent."""

    def __init__(
        self,
        address: str,
        secret: str = "",
        options: ChassisOptions | None = None,
        clock: Clock | None = None,
        link: BrickLink | None = None,
    ) -> None:
        self._clock = clock or RealClock()
        self._options = options or ChassisOptions()
        self._address = address
        self._link = link or BrickLink(address, secret)
        self._pictures: list[RemotePicture] = []

    def __enter__(self) -> Examination:
        self._link.hold("doctor", "ping")
        return self

    def __exit__(self, *_: object) -> None:
        self._link.release("doctor")

    def measure(self, may_turn_wheels: Callable[[], bool]) -> BrickFacts:
        """Return all that can be known.

        Args:
            may_turn_wheels: Asks the person; called once, before the only part that moves.

        Raises:
            DriveError: If the line is lost.
        """
        self._link.send("inspect")
        inspected = self._link.answer("inspected")
        ahead_s = float(inspected["clock_s"]) - self._clock.wall_s()
        round_trips_s = [self._round_trip_s(index) for index in range(ROUND_TRIPS)]
        camera_fault = self._look() if inspected["cameras"] else None
        body_fault, wheels = self._try_wheels(may_turn_wheels)
        return BrickFacts(
            address=self._address,
            ports=(self._options.left_port, self._options.right_port),
            release=release(),
            inspected=inspected,
            round_trips_s=round_trips_s,
            clock_ahead_s=ahead_s,
            body_fault=body_fault,
            pictures=self._pictures,
            camera_fault=camera_fault,
            wheels=wheels,
        )

    def _round_trip_s(self, index: int) -> float:
        sent_s = self._clock.now_s()
        self._link.send("ping", id=index)
        while self._link.answer("pong") != index:
            pass
        return self._clock.now_s() - sent_s

    def _look(self) -> str | None:
        """Take pictures for a while; return the camera fault that the agent reports."""
        self._link.on_picture = self._pictures.append
        self._link.send("video", device="auto", width=160, height=120, rate=30, encoding="auto")
        self._clock.sleep(PICTURES_S)
        fault = self._link.camera_fault
        self._link.send("blind")
        self._link.on_picture = None
        return fault

    def _try_wheels(
        self, may_turn_wheels: Callable[[], bool]
    ) -> tuple[str | None, list[WheelTurn] | None]:
        body = RemoteBody(self._link, self._options.ports())
        try:
            body.open()
            if not may_turn_wheels():
                return None, None
            return None, [self._turn(body, *part) for part in WHEEL_TEST]
        except DriveError as error:
            return str(error), None
        finally:
            body.close()

    def _turn(self, body: RemoteBody, left: int, right: int) -> WheelTurn:
        """Turn the wheels for one part of the test, by short moves, so that they end with us."""
        sign = -1 if self._options.reversed_motors else 1
        asked = (sign * left * WHEEL_DPS, sign * right * WHEEL_DPS)
        before = body.positions()
        began_s = self._clock.now_s()
        stalled = [False, False]
        try:
            while self._clock.now_s() - began_s < WHEEL_PART_S:
                body.run(*asked, round(1000 * ACTION_TIMEOUT_S))
                self._clock.sleep(ACTION_TIMEOUT_S / 4)
                for index, state in enumerate(self._states()):
                    stalled[index] |= "stalled" in state
        finally:
            body.stop()
        lasted_s = self._clock.now_s() - began_s
        self._clock.sleep(ROLL_OUT_S)
        after = body.positions()
        turned = [sign * (b - a) / lasted_s for a, b in zip(before, after, strict=True)]
        return WheelTurn(
            asked_dps=(left * WHEEL_DPS, right * WHEEL_DPS),
            turned_dps=(turned[0], turned[1]),
            is_stalled=(stalled[0], stalled[1]),
        )

    def _states(self) -> list[str]:
        self._link.send("states")
        return list(self._link.answer("states"))
