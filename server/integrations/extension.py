"""Interfaces for other programs: addresses for Prometheus and players, and shell completion."""

from __future__ import annotations

from server.integrations import metrics, mjpeg
from server.services import Extension


class IntegrationsExtension(Extension):
    """Adds `/metrics` and `/video.mjpg` to a robot's server."""

    routers = (metrics.router, mjpeg.router)
