"""The routes, one module for each topic, and each with a `router`.

The guard decides access (`server.gateway.rules`): a viewer may read. `services_of(request)` returns
all services. Requests that touch the learner go through `robot.loop.submit`. See
docs/reference/http.md.
"""

from __future__ import annotations

from fastapi import APIRouter


def routers() -> list[APIRouter]:
    """Import the modules and return their routers; extensions add theirs as an `Extension`."""
    from server.routes import drive, health, settings, teaching, video

    return [module.router for module in (drive, video, health, teaching, settings)]
