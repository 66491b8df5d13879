"""Interfaces for other programs: `/metrics` for Prometheus, and `/video.mjpg` for players."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import Any

from fastapi import APIRouter

from server.services import Extension, Services


class FrameAges:
    """Histogram of the ages that frames have when a viewer has drawn them, in seconds."""

    bounds = (0.025, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)

    def __init__(self) -> None:
        self.counts = [0] * (len(self.bounds) + 1)
        self.total = 0.0

    def note(self, age_s: float) -> None:
        self.counts[bisect_left(self.bounds, age_s)] += 1
        self.total += age_s


class IntegrationsExtension(Extension):
    """Adds `/metrics` and `/video.mjpg` to a robot's server."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        self.frame_ages = FrameAges()
        services.hub.broadcast.video.on_drawn = self.frame_ages.note

    @property
    def routers(self) -> Sequence[APIRouter]:
        # imported here, because `metrics` imports this module
        from server.integrations import metrics, mjpeg

        return metrics.router, mjpeg.router
