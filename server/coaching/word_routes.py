"""`/api/teaching/alike` and `/outdate`: two statements of the pilot about all examples.

See docs/reference/http.md.
"""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import APIRouter, HTTPException, Request

from robot.devices.raw_value import RawValue
from robot.policy.changes import can_be_alike
from robot.policy.history import TrainingHistory
from server.routes.answers import Route, answer
from server.services import services_of

router = APIRouter(prefix="/api", route_class=Route)
_ONE_SIDED = 20
"""If the examples contain this many turns to one side and none to the other, the page asks whether
left and right are alike."""


class AlikeWord(RawValue):
    """A request's body: whether the pilot says that left and right are alike."""

    alike: bool


@dataclass
class AlikeAnswer:
    """Whether left and right are alike, whether this can be set, and whether to ask the pilot."""

    alike: bool
    possible: bool
    one_sided: bool


@dataclass
class AlikeChanged(AlikeAnswer):
    """The setting after a change; `kept` is false if the change could not be saved."""

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
    """Return whether the pilot has said that left and right are alike."""
    services = services_of(request)
    return await services.on_loop(lambda: _alike(services.robot.loop.history))


@router.post("/teaching/alike")
async def set_alike(request: Request, body: AlikeWord) -> AlikeChanged:
    """Set whether the learner also learns the mirror image of every example, including the earlier
    ones."""
    services = services_of(request)
    try:
        _, is_kept = await services.change_learner(
            lambda history: history.edit("alike", value=body.alike)
        )
    except ValueError as error:
        raise HTTPException(409, str(error)) from error
    return answer(AlikeChanged, await show_alike(request), kept=is_kept)


def _alike(history: TrainingHistory) -> AlikeAnswer:
    """Describe whether left and right are alike. Only the loop's thread may call it."""
    policy, taught = history.policy, history.taught
    pairs = policy.kinds.mirrored().items()
    return AlikeAnswer(
        alike=policy.alike,
        possible=can_be_alike(policy),
        one_sided=any(taught[one] >= _ONE_SIDED and not taught[other] for one, other in pairs),
    )
