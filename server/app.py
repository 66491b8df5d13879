"""The application: the routes, with the guard in front of them and the services behind them."""

from __future__ import annotations

import mimetypes
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Literal

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool

from server.hosting.network import host_names
from server.hosting.static_files import CompressedFiles
from server.routes import routers
from server.security.access import Access
from server.security.guard import Guard
from server.security.pairing import cookie_name
from server.services import Services, keep_door


async def _change(services: Services, verb: Literal["start", "stop"]) -> None:
    """Start or stop the sessions of studies, which wait for loop and disk."""
    if services.conductor is not None:
        await run_in_threadpool(getattr(services.conductor, verb))


def create_app(services: Services) -> FastAPI:
    """Make the application for one robot. Nothing happens at import time.

    The caller starts and stops robot and persistence; the application starts the other services.
    Routes find all of them through `services_of(request)`.
    """
    config = services.config
    for suffix in (".js", ".mjs"):
        mimetypes.add_type("text/javascript", suffix)
    mimetypes.add_type("application/manifest+json", ".webmanifest")
    app = FastAPI(title="Drivelesson", docs_url=None, redoc_url=None)
    app.state.services = services
    keep_door(app, services.door, services.robot.clock)
    for router in routers():
        app.include_router(router)
    app.mount("/", CompressedFiles(directory=config.web_folder, html=True), name="web")

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await services.hub.start()
        try:
            with services.progress, services.study:
                await _change(services, "start")
                try:
                    yield
                finally:
                    await _change(services, "stop")
        finally:
            await services.hub.stop()

    # NOTE: set here, because FastAPI has the argument `lifespan` only since 0.93.
    app.router.lifespan_context = lifespan
    access = Access(
        names=frozenset(host_names(config)),
        allows_addresses=config.lan,
        sessions=services.pairing,
        cookie=cookie_name(config),
        members=services.classroom,
    )
    app.add_middleware(
        Guard,
        limits=config.limits,
        access=access,
        refused=services.turned_away,
        door=services.door,
        clock=services.robot.clock,
    )
    return app
