"""The application: the guard, the routes and the services."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from functools import cache

from fastapi import APIRouter, FastAPI
from starlette.concurrency import run_in_threadpool
from starlette.routing import BaseRoute

from server.gateway.guard import Guard
from server.hosting.static_files import PageFiles
from server.routes import drive, settings, teaching, video
from server.routes.answers import describe_routes
from server.routes.bodies import HANDLERS
from server.services import Services

ROUTERS = [module.router for module in (drive, video, teaching, settings)]
"""The routers of the core. An extension adds its own routers by `Extension.routers`."""
_made: dict[tuple[int, ...], tuple[list[APIRouter], list[BaseRoute]]] = {}
"""Cache of routers and their routes, by the routers' ids; all applications share it."""


def create_app(services: Services) -> FastAPI:
    """Make the application for one robot.

    The caller starts and stops the robot and the persistence, and the application all other parts.
    Routes find all services through `services_of(request)`.
    """
    config = services.config
    app = FastAPI(title="Drivelesson", docs_url=None, redoc_url=None, exception_handlers=HANDLERS)
    app.state.services = services
    app.state.gateway = services.gateway
    extensions = list(services.extensions.values())
    parts = [*ROUTERS, *(router for each in extensions for router in each.routers)]
    if (key := tuple(map(id, parts))) not in _made:
        alone = FastAPI(openapi_url=None, strict_content_type=False)
        for router in parts:
            alone.include_router(router)
        _made[key] = parts, alone.routes
    app.router.routes.extend(_made[key][1])
    app.openapi = cache(lambda: describe_routes(app, parts))  # type: ignore[method-assign]
    app.mount("/", PageFiles(config.web), name="web")

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        async with AsyncExitStack() as started:
            await services.hub.start()
            started.push_async_callback(services.hub.stop)
            for extension in extensions:
                await run_in_threadpool(extension.start)
                started.push_async_callback(run_in_threadpool, extension.stop)
            yield

    # NOTE: `lifespan` is set here, because FastAPI takes it as an argument only since 0.93.
    app.router.lifespan_context = lifespan
    app.add_middleware(Guard, gateway=services.gateway)
    return app
