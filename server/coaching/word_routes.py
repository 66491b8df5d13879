"""`/api/teaching/alike` and `/outdate`: what the pilot states about the lesson.

See docs/reference/http.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import APIRouter, HTTPException, Request

from robot.devices.raw_value import RawValue
from robot.policy.history import TrainingHistory
from server.routes.answers import Route, answer
from server.services import services_of

router = APIRouter(prefix="/api", route_class=Route)
_ONE_SIDED = 20
"""Number of one-sided turn examples after which the page asks about symmetry."""


class AlikeWord(RawValue):
    """The pilot's answer about symmetry."""

    alike: bool


@dataclass
class AlikeAnswer:
    """The setting of symmetry, whether it can be set, and whether the page should ask for it."""

    alike: bool
    possible: bool
    one_sided: bool


@dataclass
class AlikeChanged(AlikeAnswer):
    """The new setting of symmetry; `kept` is false if it could not be saved."""

    kept: bool


@router.post("/teaching/outdate")
async def outdate(request: Request) -> dict[str, int | bool]:
    """Let new examples count more than earlier ones; `kept` is false if that could not be saved."""
    services = services_of(request)
    try:
        _, is_kept = await services.change_learner(lambda history: history.edit("outdate"))
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    return {"outdated": sum(services.robot.loop.state.taught.values()), "kept": is_kept}


@router.get("/teaching/alike")
async def show_alike(request: Request) -> AlikeAnswer:
    """Return whether the pilot said that left and right are alike here."""
    services = services_of(request)
    return await services.on_loop(lambda: _alike(services.robot.loop.history))


@router.post("/teaching/alike")
async def set_alike(request: Request, body: AlikeWord) -> AlikeChanged:
    """Set whether past and future examples also count mirrored."""
    services = services_of(request)
    try:
        _, is_kept = await services.change_learner(
            lambda history: history.edit("alike", value=body.alike)
        )
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    return answer(AlikeChanged, await show_alike(request), kept=is_kept)


def _alike(history: TrainingHistory) -> AlikeAnswer:
    """Describe the setting of symmetry. Call it on the loop's thread."""
    policy, taught = history.policy, history.taught
    pairs = policy.kinds.mirrored().items()
    return AlikeAnswer(
        alike=policy.alike,
        possible=policy.can_be_alike,
        one_sided=any(taught[one] >= _ONE_SIDED and not taught[other] for one, other in pairs),
    )
