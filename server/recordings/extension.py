"""Recordings in a robot's server: their routes, and training from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import APIRouter
from starlette.requests import HTTPConnection

from robot.recordings.store import EpisodeStore
from server.recordings.part import Recordings
from server.recordings.retraining import Retraining
from server.services import Extension, Services, persistence_of, services_of


class RecordingsExtension(Extension):
    """Adds the routes of recordings, and training from recordings, to a robot's server."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self.retraining = Retraining(services.robot.clock)

    @property
    def routers(self) -> Sequence[APIRouter]:
        # imported here, because these modules import this module
        from server.recordings import retraining_routes, routes

        return routes.router, retraining_routes.router


def retraining_of(connection: HTTPConnection) -> Retraining:
    """Return the part of the server that trains a model from recordings."""
    return services_of(connection).extension(RecordingsExtension).retraining


def episodes_of(connection: HTTPConnection) -> EpisodeStore:
    """Return the recordings of the robot that got a request; answers 503 if nothing is saved."""
    return persistence_of(connection).part(Recordings).episodes
