"""The routes, one module for each topic, and each with a `router`.

The guard decides access (`server.gateway.rules`): a viewer may read. `services_of(request)` returns
all services. Requests that touch the learner go through `robot.loop.submit`. See
docs/reference/http.md.
"""

from __future__ import annotations

from importlib import import_module

from fastapi import APIRouter

MODULES = (*("drive", "video", "health", "teaching", "settings"),)
"""The modules with routes; extensions add theirs as an `Extension`."""


def routers() -> list[APIRouter]:
    """Import the modules and return their routers, in order."""
    return [import_module(f"{__name__}.{name}").router for name in MODULES]
