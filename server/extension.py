"""What a house adds to a robot's server: routes, options of `serve`, and services of its own.

An extension is an entry point of `drivelesson.services`. The core knows this class alone, so a
house can be taken away without a trace.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, ClassVar

from fastapi import APIRouter

from robot.types import StartStop
from server.security.access import Members

if TYPE_CHECKING:
    from server.services import Services

GROUP = "drivelesson.services"


class Extension(StartStop):
    """One house's part in a robot's server. Override what the house has.

    Attributes:
        routers: Routes; they get the extension by `services_of(request).extension(Kind)`.
        members: Teachers and locks that the guard asks for, if the house has any.
    """

    routers: ClassVar[Sequence[APIRouter]] = ()
    members: Members | None = None

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        """Take what is needed of the server; `options` are those of `drivelesson serve`."""

    @classmethod
    def configure(cls, parser: argparse.ArgumentParser) -> None:
        """Declare options of `drivelesson serve`."""

    def start(self) -> None:
        """Begin; may wait for the loop and the disk."""

    def stop(self) -> None:
        """End; may wait for the loop and the disk."""

    def require_free_model(self) -> None:
        """Raise ConfigurationError while the model in use must not change."""


def installed() -> list[type[Extension]]:
    """Return the extensions that are installed, in the order of their names."""
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return [point.load() for point in points]
