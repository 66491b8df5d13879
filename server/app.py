"""The application: routes, the guard in front of them, and the station behind them."""

from __future__ import annotations

import mimetypes
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI

from robot.rig.rig import Rig
from server.clients.hub import Hub
from server.config import Config
from server.hosting.network import host_names
from server.hosting.static_files import CompressedFiles
from server.persistence import recording_in
from server.progress import Progress
from server.routes import routers
from server.security.access import Access
from server.security.guard import Guard
from server.security.pairing import Pairing, cookie_name
from server.study import Study


def create_app(
    config: Config, robot: Rig, *, name: str = "robot", pairing: Pairing | None = None
) -> FastAPI:
    """Make the application for one robot. Nothing happens at import time.

    The robot is started and stopped by whoever built it; the application only listens to its
    loop while it runs. `app.state` has `hub`, `config`, `robot` and `pairing` for the routes.

    Args:
        config: What was set.
        robot: The robot, running or not.
        name: What pages call it.
        pairing: Who was let in; None lets in whoever can reach the port.
    """
    for suffix in (".js", ".mjs"):
        mimetypes.add_type("text/javascript", suffix)
    mimetypes.add_type("application/manifest+json", ".webmanifest")
    app = FastAPI(title="Drivelesson", docs_url=None, redoc_url=None)
    hub = Hub(config, robot, name)
    turned_away: Counter[str] = Counter()
    app.state.config, app.state.robot, app.state.hub = config, robot, hub
    app.state.progress = progress = Progress(robot.loop, lambda: recording_in(app.state))
    app.state.study = study = Study(robot.loop, hub.announce_soon)
    app.state.pairing, app.state.turned_away = pairing, turned_away
    for router in routers():
        app.include_router(router)
    app.mount("/", CompressedFiles(directory=config.web_folder, html=True), name="web")

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await hub.start()
        try:
            with progress, study:
                yield
        finally:
            await hub.stop()

    # NOTE: set so, and not as an argument, because FastAPI knows the argument only since 0.93.
    app.router.lifespan_context = lifespan
    access = Access(
        names=frozenset(host_names(config)),
        allows_addresses=config.lan,
        sessions=pairing,
        cookie=cookie_name(config),
    )
    app.add_middleware(Guard, limits=config.limits, access=access, refused=turned_away)
    return app
