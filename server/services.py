"""All services of one robot's server, created once and passed to the routes.

An extension adds routes and services by an entry point of `drivelesson.services`. Its package may
have a module `options`, whose function `configure(parser)` adds options to `serve`. The core knows
only the base class `Extension`, so an extension can be removed without changing the core.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, cast

from fastapi import APIRouter, HTTPException
from starlette.requests import HTTPConnection

from robot.devices.rig import Rig
from robot.entry_points import EXTENSIONS, points
from robot.policy.history import TrainingHistory
from robot.types import StartStop
from server.clients.hub import Hub
from server.config import Config
from server.gateway.gateway import Gateway, gateway_type
from server.identity import IdentityFile
from server.persistence import Persistence

_E = TypeVar("_E", bound="Extension")
_T = TypeVar("_T")


class Services:
    """The parts of one server. Routes get these parts from `services_of(request)`.

    Making a `Services` starts nothing. The caller starts and stops the robot and the persistence;
    the application starts and stops the other parts. Without persistence nothing is saved.

    Args:
        name: The robot's name, if no `hub` is given.
        options: The options of `drivelesson serve`, for the extensions.
    """

    def __init__(
        self,
        config: Config,
        robot: Rig,
        *,
        name: str = "robot",
        hub: Hub | None = None,
        persistence: Persistence | None = None,
        gateway: Gateway | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        self.config, self.robot, self.persistence = config, robot, persistence
        self.hub = hub = hub or Hub(config, robot, IdentityFile(None, name))
        self.identity = hub.identity
        self.gateway = gateway or gateway_type()(config, robot.clock)
        self.gateway.has_priority = lambda person: person == hub.pilot
        self.extensions = {kind: kind(self, options or {}) for kind in installed()}

    def extension(self, kind: type[_E]) -> _E:
        """Return an extension by its class; raises KeyError if it is not installed."""
        return cast(_E, self.extensions[kind])

    async def on_loop(self, call: Callable[[], _T]) -> _T:
        """Call a function on the loop's thread between two ticks; return its result."""
        return await asyncio.wrap_future(self.robot.loop.submit(call))

    def note_carried(self) -> None:
        """Tell the extensions that a person moved the robot. Only the loop's thread may call it."""
        for extension in self.extensions.values():
            extension.note_carried()

    def shown(self) -> dict[str, Any]:
        """Return this robot's data for the board of its class, as values by name."""
        parts = self.extensions.values()
        return {name: value for part in parts for name, value in part.shown().items()}

    def show(self) -> None:
        """Send the data of `shown` to all clients when it has changed. Any thread may call this."""
        self.hub.broadcast.announce("shown", shown=self.shown())

    async def change_learner(self, change: Callable[[TrainingHistory], _T]) -> tuple[_T, bool]:
        """Change the learner on the loop's thread; return the result, and whether it is saved.

        A saved change is in the journal and survives a power cut. A change that could not be saved
        is made nevertheless; the answer to the client must say that it is not saved.
        """
        history = self.robot.loop.history
        made, number = await self.on_loop(lambda: (change(history), history.changes))
        if self.persistence is None:
            return made, False
        return made, await self.persistence.writer.written(number)


class Extension(StartStop):
    """Base class of an extension's part in a server; a subclass overrides the methods it needs."""

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        """Store the parts of the server; `options` are those of `drivelesson serve`."""

    @property
    def routers(self) -> Sequence[APIRouter]:
        """Return the routes; these get the extension by `services_of(request).extension(Class)`."""
        return ()

    def prepare(self) -> None:
        """Set up the running robot before its model is chosen and the server starts."""

    def greet(self) -> list[str]:
        """Return lines that the terminal shows when the robot is ready."""
        return []

    def shown(self) -> Mapping[str, Any]:
        """Return data for the board of the class. Call `Services.show` after each change."""
        return {}

    def start(self) -> None:
        """Start the extension; may wait for the loop and the disk."""

    def stop(self) -> None:
        """Stop the extension; may wait for the loop and the disk."""

    def note_carried(self) -> None:
        """Called on the loop's thread when somebody has moved the robot by hand."""

    def require_free_model(self) -> None:
        """Raise ConfigurationError while the model in use must not change."""


def installed() -> list[type[Extension]]:
    """Return the classes of the installed extensions, in the order of their names."""
    return [point.load() for point in points(EXTENSIONS)]


def services_of(connection: HTTPConnection) -> Services:
    services: Services = connection.app.state.services
    return services


def persistence_of(connection: HTTPConnection) -> Persistence:
    """Return the server's persistence; answer 503 if the server saves nothing."""
    persistence = services_of(connection).persistence
    if persistence is None:
        raise HTTPException(503, "Nothing is saved here: start the server with --data FOLDER.")
    return persistence
