"""Saves the learner automatically, and loads the saved model at the next start.

The disk's thread copies the learner between two ticks, and writes the copy. A save is due after
every change of mode, undo or edit; every ten seconds of teaching; and at the end. The journal
contains the changes between two saves.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Collection
from functools import partial

from robot.control.loop import ControlLoop
from robot.errors import ConfigurationError, RobotError, reason
from robot.moves import CLASSIC
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.store.disk import Announce, no_announcement
from robot.store.models.journal import Journal
from robot.store.models.model import Model, take_model
from robot.store.models.recovery import Recovered
from robot.store.models.store import ModelStore
from robot.types import Action, Mode

log = logging.getLogger(__name__)

SAVE_EVERY_S = 10.0


class Autosave:
    """Manages the model that the robot uses, and saves it automatically.

    `name` is the name of a new model until a person renames it. A model with moves that are not in
    `moves` is not loaded. `announce` is called with events for the page.
    """

    def __init__(
        self,
        loop: ControlLoop,
        store: ModelStore,
        journal: Journal,
        *,
        name: str = "robot",
        moves: Collection[Action] = tuple(CLASSIC),
        announce: Announce = no_announcement,
    ) -> None:
        self._loop = loop
        self._clock = loop.clock
        self.store = store
        self._wanted_name = name
        self._moves = frozenset(moves)
        self._place = ""
        self.announce = announce
        self._journal = journal
        self.name: str | None = None
        """Name of the model in use; None until the learner is taught."""
        self.lock = self._clock.lock()
        """A lock that is held while the model in use is saved or replaced."""
        self._unsubscribe: Callable[[], None] | None = None
        self._seen = (Mode.STOPPED, 0)  # mode and number of edits at the last check
        self._saved_changes = loop.history.changes
        self._saved_s = 0.0

    @property
    def has_unsaved(self) -> bool:
        """True if the learner was changed since it was last saved or loaded."""
        return self._loop.history.changes != self._saved_changes

    def start(self) -> None:
        note = partial(self._journal.note, self._loop.history, lambda: (self.name, self._place))
        self._unsubscribe = self._loop.subscribe(note)

    def stop(self) -> None:
        """Save once more and end. Call this while the loop still runs. Idempotent."""
        unsubscribe, self._unsubscribe = self._unsubscribe, None
        if unsubscribe is not None:
            unsubscribe()
            self.save_if_changed()

    def save_if_due(self) -> None:
        """Check whether a save is due, and save. Call it on the disk's thread."""
        now_s, before = self._clock.now_s(), self._seen
        self._seen = self._loop.mode, self._loop.history.edits
        is_due = self._seen != before or now_s - self._saved_s >= SAVE_EVERY_S
        if is_due and self.has_unsaved:
            self._saved_s = now_s
            self.save_if_changed()

    def save_if_changed(self) -> None:
        """Save if the learner was changed. Never raises: a failure is announced and retried."""
        if not self.has_unsaved:
            return
        try:
            with self.lock:  # wait until another thread has loaded or saved a model
                if self.has_unsaved:
                    self.save()
        except Exception as error:  # the thread must continue after any error
            expected = isinstance(error, OSError | RobotError)
            log.warning("the model was not saved: %s", error, exc_info=not expected)
            self.announce("model_not_saved", detail=reason(error))

    def save(self, place: str | None = None) -> str:
        """Save the learner's state, and its place if one is given; return the model's name."""
        with self.lock:
            place = self._place if place is None else place
            copied = self._loop.submit(lambda: self._journal.copy(self._loop.history, place))
            model = self._clock.result(copied, 10.0)
            name = self.name or self.store.free_name(self._wanted_name)
            self.store.save(name, model)
            self.name, self._place = name, place
            assert model.summary.position is not None
            self._saved_changes = model.summary.position.change
            if self.store.current != name:
                self.store.current = name
            self.announce("model_saved", model=name, lessons=model.summary.n_examples)
            return name

    def load_last(self, learner: str | None = None) -> str | None:
        """Load the model used last, or else the newest valid model; return its name, or None."""
        self.save_if_changed()
        if self.has_unsaved:
            return self.name
        unfit: list[str] = []
        for name, model in self.store.good_models():
            if learner in (None, model.summary.learner):
                if not (lacking := self._lacks(model)):
                    self._use(name, model)
                    break
                unfit.append(f"{name} ({lacking})")
        else:
            name = None
        self._tell_unfit(unfit)
        return name

    def adopt(self, recovered: Recovered) -> None:
        """Use the recovered model, and save it immediately if possible."""
        with self.lock:
            if lacking := self._lacks(recovered.model):
                name = recovered.name or self.store.free_name(self._wanted_name)
                self.store.save(name, recovered.model)
                self._tell_unfit([f"{name} ({lacking})"])
                return
            self._use(recovered.name, recovered.model)
            self._saved_changes = -1
            log.info("recovered changes=%d model=%s", recovered.replayed, recovered.name)
            self.save_if_changed()

    def load(self, name: str) -> None:
        """Save the model in use, and load another; raises ConfigurationError unless the robot is
        stopped."""
        with self.lock:
            if self.has_unsaved:
                self.save()
            model = self.store.load(name)
            if lacking := self._lacks(model):
                raise ConfigurationError(
                    f"the model {name!r} has moves that this robot does not have: {lacking}"
                )
            self._use(name, model)

    def begin(
        self,
        name: str | None = None,
        learner: str | None = None,
        place: str | None = None,
        moves: tuple[Action, ...] | None = None,
        prepare: Callable[[Policy], None] = lambda policy: None,
    ) -> str:
        """Save the model in use, and begin an empty model; return the new model's name.

        `prepare` changes the new policy before it is saved, or raises an error.
        """
        with self.lock:
            learner = learner or self._loop.state.learner
            place = self._place if place is None else place.strip()
            policy = make_policy(learner, moves or self._loop.state.moves)
            position = self._journal.position(self._loop.history.changes)
            self._check_stopped()
            if self.has_unsaved:
                self.save()
            prepare(policy)
            model = take_model(policy, {}, place=place, position=position)
            new_name = self.store.free_name(name or self._wanted_name)
            self.store.save(new_name, model)
            self._use(new_name, model)
            return new_name

    def _lacks(self, model: Model) -> str:
        """Return the model's moves that this robot does not have, as text."""
        return ", ".join(sorted(set(model.summary.moves) - self._moves))

    def _tell_unfit(self, models: list[str]) -> None:
        """Report the models that are not used, because this robot does not have their moves."""
        if models:
            log.warning("models with moves that this robot does not have: %s", ", ".join(models))
            self.announce("unfit", detail=", ".join(models)[:300])

    def _check_stopped(self) -> None:
        if self._loop.mode is not Mode.STOPPED:
            raise ConfigurationError("stop the robot before you change its model")

    def _use(self, name: str | None, model: Model) -> None:
        """Replace the model of the loop, between two ticks and only while the robot is stopped."""
        policy, taught = model.to_policy(), Counter(model.summary.taught)

        def replace() -> int:
            self._check_stopped()
            self._loop.history.replace_policy(policy, taught)
            # Set the name on the loop's thread, so that the journal's next entries have it.
            self.name, self._place = name, model.summary.place
            return self._loop.history.changes

        self._saved_changes = self._clock.result(self._loop.submit(replace), 10.0)
        if name is not None and name in self.store.names():
            try:
                self.store.current = name
            except OSError as error:
                log.warning("the name of the model in use was not saved: %s", error)
        self.announce("model_loaded", model=name)

    def delete(self, name: str) -> str:
        """Delete a model. If it is in use, the robot keeps the learner as an unnamed model."""
        with self.lock:
            if self.name == name and self.has_unsaved:
                self.save()
            key = self.store.delete(name)
            if self.name == name:
                self.name, self._saved_changes = None, self._loop.history.changes
                self._journal.note_saved(self._saved_changes)
            return key
