"""Studies as a part of a robot's server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from robot.errors import ConfigurationError
from server.extension import Extension
from server.study import routes
from server.study.conductor import Conductor
from server.study.folder import StudyFolder

if TYPE_CHECKING:
    from server.services import Services


class StudyExtension(Extension):
    """Sessions of studies with participants.

    Attributes:
        conductor: Conducts them; None where nothing is saved.
    """

    routers = (routes.router,)

    def __init__(self, services: Services, options: Mapping[str, Any]) -> None:
        kept = services.persistence
        self.conductor: Conductor | None = None
        if kept is not None:
            self.conductor = Conductor(
                services.robot,
                StudyFolder(kept.storage),
                kept.autosave,
                services.events.publish,
                lambda: kept.recording,
                kept.recorder.keep,
            )

    def start(self) -> None:
        if self.conductor is not None:
            self.conductor.start()

    def stop(self) -> None:
        if self.conductor is not None:
            self.conductor.stop()

    def require_free_model(self) -> None:
        """Raise ConfigurationError while a participant's session is on."""
        if self.conductor is not None and self.conductor.session is not None:
            raise ConfigurationError("A participant's session is on: leave it first.")
