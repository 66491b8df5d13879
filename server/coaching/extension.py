"""Coaching in a robot's server: progress, readiness, the driven path and the gallery."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastapi import APIRouter
from starlette.requests import HTTPConnection

from server.coaching.progress import Progress
from server.services import Extension, Services, services_of


class CoachingExtension(Extension):
    """Tracks the training for the page."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self._loop = services.robot.loop
        self.progress = Progress(self._loop, services.persistence)
        self._unsubscribe: Callable[[], None] = lambda: None

    @property
    def routers(self) -> Sequence[APIRouter]:
        from server.coaching import (  # imported here, because these modules import this one
            gallery_routes,
            routes,
            word_routes,
        )

        return routes.router, gallery_routes.router, word_routes.router

    def start(self) -> None:
        self._unsubscribe = self._loop.subscribe(self.progress.note)

    def stop(self) -> None:
        self._unsubscribe()

    def note_carried(self) -> None:
        self.progress.trail.begin()
        self.progress.readiness.note_carried()


def progress_of(connection: HTTPConnection) -> Progress:
    """Return the training progress of the robot that got a request."""
    return services_of(connection).extension(CoachingExtension).progress
