"""Loads a session's model into the robot, and after the session the robot's own model again.

A participant's model is among the robot's models only while the session is driven. After the
session, that model is stored beside the session's log. The file `StudyFolder.active` names the
session's model. If the power failed during the session, the next start of the program reads this
file, and the robot gets its own model again.
"""

from __future__ import annotations

from typing import Any

from robot.devices.rig import Rig
from robot.store.folder import write_whole
from robot.store.models.autosave import Autosave
from robot.study.plan import Condition
from robot.types import Action, Mode
from server.study.folder import SessionModel, StudyFolder, model_name

PATIENCE_S = 10.0


class SessionModels:
    """Gives the robot a session's model, and later its previous model again. The methods may wait
    for the control loop and the disk."""

    def __init__(self, rig: Rig, folder: StudyFolder, autosave: Autosave) -> None:
        self.in_use: SessionModel | None = None
        self._loop, self._clock = rig.loop, rig.clock
        self._folder, self._autosave = folder, autosave

    def put_in_use(
        self, study: str, participant: str, position: int, condition: Condition, *, anew: bool
    ) -> bool:
        """Use the participant's saved model of this condition, or an empty one.

        Returns True if the model is empty, because `anew` is True or no model was saved.
        After a ConfigurationError or OSError the robot still has its previous model.
        """
        path = self._folder.model_path(study, participant, position)
        kept = path.read_bytes() if not anew and path.is_file() else None
        autosave = self._autosave
        self._stop()
        state = self._loop.state
        before = autosave.save() if any(state.taught.values()) else autosave.name
        model = SessionModel(
            study=study,
            participant=participant,
            position=position,
            own=autosave.store.free_name(model_name(study, participant, position)),
            before=before,
            learner_before=state.learner,
            moves_before=list(map(str, state.moves)),
        )
        self._folder.active = model
        try:
            if kept is None:
                autosave.begin(model.own, condition.learner, condition.world, condition.moves)
            else:
                autosave.load(autosave.store.add_file(model.own, kept))
        except BaseException:
            self._folder.active = None
            raise
        self.in_use = model
        return kept is None

    def put_away(self) -> None:
        """Save the session's model beside its log, and use the previous model again."""
        model, autosave = self._folder.active, self._autosave
        self.in_use = None
        if model is None:
            return
        self._stop()
        is_in_use = autosave.name == model.own
        if is_in_use and autosave.has_unsaved:
            autosave.save()
        if model.own in autosave.store.names():
            path = self._folder.model_path(model.study, model.participant, model.position)
            write_whole(path, autosave.store.read_file(model.own))
        if is_in_use:
            if model.before is not None and model.before in autosave.store.names():
                autosave.load(model.before)
            else:
                # There is no saved model to go back to, so begin an empty one, and do not save it.
                moves = tuple(map(Action, model.moves_before))
                autosave.delete(autosave.begin(None, model.learner_before, None, moves))
        if model.own in autosave.store.names():
            autosave.delete(model.own)
        self._folder.active = None

    def _stop(self) -> Any:
        return self._clock.result(self._loop.set_mode(Mode.STOPPED), PATIENCE_S)
