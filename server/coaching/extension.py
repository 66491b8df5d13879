"""Coaching in a robot's server: progress, readiness, the driven path and the gallery."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastapi import APIRouter
from starlette.requests import HTTPConnection

from server.coaching.progress import Progress
from server.services import Extension, Services, services_of


class CoachingExtension(Extension):
    """Tracks the training for the page."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self._loop, self._broadcast = services.robot.loop, services.hub.broadcast
        self.progress = Progress(self._loop, services.persistence)
        self._ends: list[Callable[[], object]] = []

    @property
    def routers(self) -> Sequence[APIRouter]:
        from server.coaching import (  # imported here, because these modules import this one
            gallery_routes,
            routes,
            word_routes,
        )

        return routes.router, gallery_routes.router, word_routes.router

    def start(self) -> None:
        self._ends = [self._loop.subscribe(one) for one in self.progress.listeners]
        if (event_loop := self._broadcast.event_loop) is not None:
            following = asyncio.run_coroutine_threadsafe(self.progress.follow(), event_loop)
            self._ends.append(following.cancel)

    def stop(self) -> None:
        for end in self._ends:
            end()

    def note_carried(self) -> None:
        self.progress.trail.begin()
        self.progress.lesson.note_carried()


def progress_of(connection: HTTPConnection) -> Progress:
    """Return the training progress of the robot that got a request."""
    return services_of(connection).extension(CoachingExtension).progress
