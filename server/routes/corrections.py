"""`/api/corrections`: how body and camera are built otherwise. See docs/reference/http.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from fastapi import APIRouter, Request

from robot.corrections import MOST_TRIM, REVERSED, TURNS_DEG
from robot.devices.raw_value import RawValue, must_be, number
from server.routes.answers import Route
from server.routes.bodies import FREE_MODEL, do
from server.services import Services, services_of

router = APIRouter(prefix="/api/corrections", route_class=Route)


class CorrectionsChange(RawValue):
    """The corrections to change."""

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
    """The corrections, and the names of those that apply to this robot and its camera."""

    reverse: str
    swap_sides: bool
    trim: float
    turn_picture: int
    mirror_picture: bool
    possible: list[str]


@dataclass
class CorrectionsChanged(CorrectionsAnswer):
    """The corrections after a change; `kept` is false if the next start would not have them."""

    kept: bool


def _answer(services: Services) -> dict[str, object]:
    possible = services.corrections.possible
    return {**services.robot.corrections.described(), "possible": list(possible)}


@router.get("")
def show_corrections(request: Request) -> CorrectionsAnswer:
    """Return how body and camera are corrected, and what can be."""
    return CorrectionsAnswer(**_answer(services_of(request)))  # type: ignore[arg-type]


@router.put("", dependencies=[FREE_MODEL])
async def change_corrections(request: Request, body: CorrectionsChange) -> CorrectionsChanged:
    """Stop the robot, and correct body and camera; 409 for what does not apply to them."""
    services = services_of(request)
    given = {name: getattr(body, name) for name in type(body).__annotations__}
    await services.change_corrections(given)
    try:
        is_kept = await do(services.corrections.save)
    except OSError:
        is_kept = False
    return CorrectionsChanged(**_answer(services), kept=is_kept)  # type: ignore[arg-type]
