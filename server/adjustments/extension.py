"""`/api/corrections`: corrections for a body or camera that differs from the driver's default.

See docs/reference/http.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from fastapi import APIRouter, Request

from robot.adjustments.corrections import MOST_TRIM, REVERSED, TURNS_DEG, Corrections
from robot.devices.raw_value import RawValue, must_be, number
from robot.types import StopReason
from server.adjustments.file import CorrectionsFile
from server.routes.answers import Route, answer
from server.routes.bodies import FREE_MODEL, do
from server.services import Extension, Services, services_of

router = APIRouter(prefix="/api/corrections", route_class=Route)
_T = TypeVar("_T", bound="CorrectionsAnswer")


class AdjustmentsExtension(Extension):
    """Corrects the body and the camera of one robot. The corrections come from the command line,
    the data folder and the page."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self._services = services
        persistence = services.persistence
        folder = persistence.storage.root if persistence is not None else None
        self.file = CorrectionsFile(folder, services.robot, options)

    @property
    def routers(self) -> Sequence[APIRouter]:
        """Return `/api/corrections`."""
        return (router,)

    def prepare(self) -> None:
        """Correct the running robot; later recordings contain the corrections as metadata."""
        self.file.apply()
        robot, persistence = self._services.robot, self._services.persistence
        if persistence is not None:
            now, note = Corrections.of(robot).described(), persistence.note_options
            robot.clock.result(robot.loop.submit(lambda: note(now)))

    async def change(self, given: Mapping[str, Any]) -> None:
        """Stop the robot, and set the given corrections of body and camera.

        The current recording ends, so that the next one gets the new corrections as metadata.

        Raises:
            ConfigurationError: If a correction does not apply to this body or camera.
        """
        services, robot = self._services, self._services.robot
        wanted = Corrections.of(robot).changed(**given)
        is_new_view = wanted.camera != Corrections.of(robot).camera

        def correct() -> None:
            wanted.apply(robot)
            if is_new_view:
                services.note_carried()
            if services.persistence is not None:
                services.persistence.note_options(wanted.described())

        robot.loop.trip(StopReason.PILOT_ASKED)
        await services.on_loop(correct)


class CorrectionsChange(RawValue):
    """A request's body: the corrections to change."""

    reverse: Literal["none", "left", "right", "both"] | None = must_be(
        f"one of {', '.join(REVERSED)}", None
    )
    swap_sides: bool | None = must_be("true or false", None)
    trim: float | None = number(None, least=-MOST_TRIM, most=MOST_TRIM)
    turn_picture: Literal[0, 90, 180, 270] | None = must_be(
        f"one of {', '.join(map(str, TURNS_DEG))}", None
    )
    mirror_picture: bool | None = must_be("true or false", None)


@dataclass
class CorrectionsAnswer:
    """The corrections of a robot, and the names of those that apply to its body and camera."""

    reverse: str
    swap_sides: bool
    trim: float
    turn_picture: int
    mirror_picture: bool
    possible: list[str]


@dataclass
class CorrectionsChanged(CorrectionsAnswer):
    """The corrections after a change; `kept` is false if saving them failed."""

    kept: bool


def _answer(kind: type[_T], services: Services, **more: object) -> _T:
    possible = list(services.extension(AdjustmentsExtension).file.possible)
    now = Corrections.of(services.robot).described()
    return answer(kind, None, **now, possible=possible, **more)


@router.get("")
def show_corrections(request: Request) -> CorrectionsAnswer:
    """Return the corrections, and which of them apply to this body and camera."""
    return _answer(CorrectionsAnswer, services_of(request))


@router.put("", dependencies=[FREE_MODEL])
async def change_corrections(request: Request, body: CorrectionsChange) -> CorrectionsChanged:
    """Stop the robot, and correct body and camera; 409 if a correction does not apply to them."""
    services = services_of(request)
    given = {name: getattr(body, name) for name in type(body).__annotations__}
    corrections = services.extension(AdjustmentsExtension)
    await corrections.change(given)
    try:
        is_kept = await do(corrections.file.save)
    except OSError:
        is_kept = False
    return _answer(CorrectionsChanged, services, kept=is_kept)
