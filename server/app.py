"""The application: the routes, with the guard in front of them and the services behind them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from functools import cache

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool

from server.access.guard import Guard
from server.access.pairing import cookie_name
from server.access.proxies import Proxies
from server.access.rules import Access
from server.hosting.static_files import PageFiles
from server.routes import routers
from server.routes.answers import describe_routes
from server.routes.bodies import HANDLERS
from server.services import Services, install_admission


def create_app(services: Services) -> FastAPI:
    """Make the application for one robot. Nothing happens at import time.

    The caller starts and stops robot and persistence; the application starts the other services.
    Routes find all of them through `services_of(request)`.
    """
    config = services.config
    app = FastAPI(
        title="Drivelesson",
        docs_url=None,
        redoc_url=None,
        exception_handlers=HANDLERS,
        strict_content_type=False,
    )
    app.state.services = services
    install_admission(app, services.admission, services.robot.clock)
    extensions = list(services.extensions.values())
    parts = [*routers(), *(router for each in extensions for router in each.routers)]
    for router in parts:
        app.include_router(router)
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

    # NOTE: set here, because FastAPI has the argument `lifespan` only since 0.93.
    app.router.lifespan_context = lifespan
    access = Access(
        names=services.surroundings,
        addresses=lambda: services.surroundings.page_addresses,
        allows_addresses=config.needs_pairing,
        find_session=services.pairing.find if services.pairing else None,
        cookie=cookie_name(config),
        public=config.public,
        members=next((each.members for each in extensions if each.members), None),
    )
    proxies = Proxies(config.public, config.proxies, admits_all=services.pairing is None)
    services.admission.recognise = lambda head, address: (
        None if config.public and proxies.is_proxy(address) else access.session_in(head)
    )
    app.add_middleware(
        Guard,
        access=access,
        refused=services.turned_away,
        admission=services.admission,
        clock=services.robot.clock,
        proxies=proxies,
    )
    return app
