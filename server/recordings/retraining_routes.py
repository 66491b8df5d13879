"""`/api/retraining`: train a new model from recordings, then save or drop it."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, HTTPException, Request

from robot.devices.raw_value import RawValue, must_be, text
from server.recordings.extension import episodes_of, retraining_of
from server.routes.answers import Route
from server.routes.bodies import FREE_MODEL, NAMED, Named, Short
from server.services import persistence_of, services_of

router = APIRouter(prefix="/api/retraining", route_class=Route)
_MOST_EPISODES = 100


class RetrainingOrder(RawValue):
    """A request's body: the recordings from which an empty learner is trained."""

    episodes: list[Short] = must_be("a list of recordings' names")
    learner: str | None = text(None)


@router.get("")
def describe_retraining(request: Request) -> dict[str, Any]:
    """Return the state of the run: idle, running, done or failed."""
    return retraining_of(request).describe()


@router.post("", status_code=202)
def begin_retraining(request: Request, body: RetrainingOrder) -> dict[str, Any]:
    """Begin to train an empty learner from recordings."""
    if len(body.episodes) > _MOST_EPISODES:
        raise HTTPException(
            400, f"The robot can learn from at most {_MOST_EPISODES} recordings at once."
        )
    services = services_of(request)
    learner = body.learner or services.robot.loop.state.learner
    store = episodes_of(request)
    retraining_of(request).begin(store, body.episodes, learner)
    return retraining_of(request).describe()


@router.post("/keep", dependencies=[FREE_MODEL], status_code=201)
def keep(request: Request, body: Named = NAMED) -> dict[str, str]:
    """Save the trained model and load it; 409 unless the robot is stopped."""
    services, persistence = services_of(request), persistence_of(request)
    model = retraining_of(request).take()
    kept = persistence.models.free_name(body.name or services.identity.now.name)
    persistence.models.save(kept, model)
    try:
        persistence.autosave.load(kept)
    except BaseException:
        persistence.models.delete(kept)
        raise
    retraining_of(request).drop()
    return {"name": kept}


@router.delete("")
def drop(request: Request) -> dict[str, Any]:
    """Drop the trained model, or cancel the run."""
    retraining_of(request).drop()
    return {"state": "idle"}
