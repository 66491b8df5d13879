"""The routes, one module for each topic, and each with a `router`.

Who may ask for what is the guard's (`server.access.rules`): a viewer may read. All services are
in `services_of(request)`. Requests that touch the learner go through `robot.loop.submit`. See
docs/reference/http.md.
"""

from __future__ import annotations

from importlib import import_module

from fastapi import APIRouter

MODULES = (
    *("routes.drive", "routes.video", "routes.health", "access.pairing_routes", "routes.models"),
    *("recordings.routes", "coaching.gallery_routes", "routes.teaching"),
    *("recordings.retraining_routes", "simulator.routes", "routes.settings"),
)
"""Modules with routes, in `server`; extensions add theirs as an `Extension`."""


def routers() -> list[APIRouter]:
    """Import the modules and return their routers, in order."""
    return [import_module(f"server.{name}").router for name in MODULES]
