"""Studies as a part of a robot's server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from robot.errors import ConfigurationError
from server.extension import Extension
from server.study import lesson_routes, routes
from server.study.conductor import Conductor
from server.study.folder import StudyFolder
from server.study.lesson import Study

if TYPE_CHECKING:
    from server.services import Services


class StudyExtension(Extension):
    """The guided trial of one person, and sessions of studies with participants.

    Attributes:
        study: The guided trial of one person.
        conductor: Sessions with participants; None where nothing is saved.
    """

    routers = (lesson_routes.router, routes.router)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        robot, persistence = services.robot, services.persistence

        def recording() -> str | None:
            return persistence.recording if persistence is not None else None

        self.study = Study(robot.loop, robot.clock, services.events.publish, recording)
        self.conductor = (
            Conductor(
                robot,
                StudyFolder(persistence.storage),
                persistence.autosave,
                services.events.publish,
                recording,
            )
            if persistence is not None
            else None
        )

    def start(self) -> None:
        """Follow the loop; put away what a power cut left in use."""
        self.study.start()
        if self.conductor is not None:
            self.conductor.start()

    def stop(self) -> None:
        """End the session as if it had been left."""
        if self.conductor is not None:
            self.conductor.stop()
        self.study.stop()

    def require_free_model(self) -> None:
        """Raise ConfigurationError while a participant's session is on."""
        if self.conductor is not None and self.conductor.session is not None:
            raise ConfigurationError("A participant's session is on: leave it first.")
