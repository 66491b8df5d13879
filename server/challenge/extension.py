"""The challenge in a robot's server: `/api/challenge`. See docs/reference/http.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fastapi import APIRouter
from starlette.requests import HTTPConnection

from robot.challenge.tries import TRIES, TRY_S, Challenge
from robot.control.state import Tick
from robot.devices.raw_value import RawValue, must_be
from server.routes.answers import Route
from server.services import Extension, Services, services_of

router = APIRouter(prefix="/api/challenge", route_class=Route)


class ChallengeExtension(Extension):
    """Counts the tries of one robot: autonomous drives that the page announced as tries."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self._services, self._loop = services, services.robot.loop
        self.challenge = Challenge()
        self._unsubscribe: Callable[[], None] | None = None

    @property
    def routers(self) -> Sequence[APIRouter]:
        return (router,)

    def stop(self) -> None:
        if self._unsubscribe is not None:
            self._unsubscribe()

    def arm(self) -> None:
        """Count the robot's next autonomous drive as a try. Call this on the loop's thread."""
        self.challenge.arm()
        if self._unsubscribe is None:
            self._unsubscribe = self._loop.subscribe(self._note)

    def note_carried(self) -> None:
        self.challenge.cancel()

    def shown(self) -> Mapping[str, Any]:
        challenge = self.challenge
        if not challenge.is_shown or challenge.best_m is None:
            return {}
        return {"challenge": {"best_m": challenge.best_m, "tries": len(challenge.tries)}}

    def _note(self, tick: Tick) -> None:
        before = self.shown()
        done = self.challenge.note(tick)
        persistence = self._services.persistence
        if done is not None and persistence is not None:
            number, best_m = len(self.challenge.tries), self.challenge.best_m
            persistence.write_result("challenge", {"try": number, **asdict(done), "best_m": best_m})
        if self.shown() != before:
            self._services.show()


@dataclass
class TryAnswer:
    """One try that has ended."""

    metres: float
    seconds: float
    ended_by: str


@dataclass
class ChallengeAnswer:
    """The state of the challenge; `can_measure` is false if the robot's position is unknown."""

    can_measure: bool
    is_armed: bool
    is_on: bool
    metres: float
    left_s: float
    tries: list[TryAnswer]
    tries_of: int
    try_s: float
    best_m: float | None
    is_shown: bool


class ChallengeShown(RawValue):
    """A request's body: true to show the best try on the class's board, false to hide it."""

    is_shown: bool = must_be("true or false")


@router.get("")
async def get_challenge(connection: HTTPConnection) -> ChallengeAnswer:
    """Return the state of the challenge."""
    return _answer(connection)


@router.post("/try")
async def post_try(connection: HTTPConnection) -> ChallengeAnswer:
    """Count the robot's next autonomous drive as a try."""
    services = services_of(connection)
    await services.on_loop(services.extension(ChallengeExtension).arm)
    return _answer(connection)


@router.delete("/try")
async def delete_try(connection: HTTPConnection) -> ChallengeAnswer:
    """Cancel the announced or running try; it does not count."""
    services = services_of(connection)
    await services.on_loop(services.extension(ChallengeExtension).challenge.cancel)
    return _answer(connection)


@router.put("")
async def put_challenge(connection: HTTPConnection, body: ChallengeShown) -> ChallengeAnswer:
    """Show or hide the best try on the board of the class."""
    services = services_of(connection)
    challenge = services.extension(ChallengeExtension).challenge

    def choose() -> None:
        challenge.is_shown = body.is_shown

    await services.on_loop(choose)
    services.show()
    return _answer(connection)


def _answer(connection: HTTPConnection) -> ChallengeAnswer:
    services = services_of(connection)
    challenge = services.extension(ChallengeExtension).challenge
    return ChallengeAnswer(
        can_measure=services.robot.loop.state.sensors.pose is not None,
        is_armed=challenge.is_armed,
        is_on=challenge.is_on,
        metres=round(challenge.metres, 2),
        left_s=round(challenge.left_s, 1),
        tries=[TryAnswer(one.metres, one.seconds, one.ended_by.value) for one in challenge.tries],
        tries_of=TRIES,
        try_s=TRY_S,
        best_m=challenge.best_m,
        is_shown=challenge.is_shown,
    )
