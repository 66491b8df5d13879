"""Keeps what the robot learns: saved by itself, loaded again at the next start.

The loop's thread only takes note; a thread of its own asks the loop for a copy of the learner and
writes it. Saved are: every change of mode, every ten seconds of teaching, and the end.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection

from robot.control.loop import ControlLoop
from robot.control.state import Tick
from robot.errors import ConfigurationError, RobotError
from robot.models.model import Model, take_model, with_preview
from robot.models.store import ModelStore
from robot.moves import CLASSIC
from robot.policy.registry import make_policy
from robot.types import Action, Mode

log = logging.getLogger(__name__)

SAVE_EVERY_S = 10.0
Announce = Callable[..., None]
"""Told that something happened once: a name, and fields of its own."""


def say_nothing(name: str, **fields: object) -> None:
    """Announce to nobody."""


class Autosave:
    """Owns which model is in use, and saves it.

    Args:
        loop: Whose learner is kept.
        shelf: Where it is kept.
        name: What a new model is called, before a person names it.
        moves: What the robot's body can do; a model that wants more is not loaded.
        place: Where the robot is, as far as anybody said.
        announce: Told of what happened: a name and fields; for the page.
    """

    def __init__(
        self,
        loop: ControlLoop,
        store: ModelStore,
        *,
        name: str = "robot",
        moves: Collection[Action] = tuple(CLASSIC),
        place: str = "",
        announce: Announce = say_nothing,
    ) -> None:
        self._loop = loop
        self.store = store
        self._wanted_name = name
        self._moves = frozenset(moves)
        self._place = place
        self.announce = announce
        self._name: str | None = None
        self._lock = threading.RLock()
        self._due = threading.Event()
        self._ending = False
        self._thread: threading.Thread | None = None
        self._unsubscribe: Callable[[], None] = lambda: None
        self._mode = Mode.STOPPED
        self._saved_changes = loop.history.changes
        self._saved_s = 0.0

    @property
    def name(self) -> str | None:
        """Name of the model in use; None until there is something to save."""
        return self._name

    @property
    def has_unsaved(self) -> bool:
        """Whether the learner was changed since it was last saved or loaded."""
        return self._loop.history.changes != self._saved_changes

    def start(self) -> None:
        """Begin to keep."""
        self._unsubscribe = self._loop.subscribe(self.note)
        self._thread = threading.Thread(target=self._run, name="model-keeper", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Save once more and end; call it while the loop still turns. Idempotent."""
        if self._thread is None:
            return
        self._unsubscribe()
        self._ending = True
        self._due.set()
        self._thread.join(timeout=10.0)
        self._thread = None
        self.save_if_changed()

    def note(self, tick: Tick) -> None:
        """Take note of one turn, on the loop's thread."""
        mode_changed = tick.decision.mode is not self._mode
        self._mode = tick.decision.mode
        if self.has_unsaved and (mode_changed or tick.now_s - self._saved_s >= SAVE_EVERY_S):
            self._saved_s = tick.now_s
            self._due.set()

    def _run(self) -> None:
        while not self._ending:
            self._due.wait()
            self._due.clear()
            self.save_if_changed()

    def save_if_changed(self) -> None:
        """Save if anything was learned since; a disk that refuses is told and tried again."""
        if self.has_unsaved:
            try:
                self.save()
            except (OSError, RobotError) as error:
                log.warning("the model was not saved: %s", error)
                self.announce("model_not_saved", detail=str(error))

    def save(self) -> str:
        """Save the learner as it is now; return the model's name."""
        with self._lock:
            model, changes = self._take()
            if self._name is None:
                self._name = self.store.free_name(self._wanted_name)
            self.store.save(self._name, model)
            if self.store.current != self._name:
                self.store.current = self._name
            self._saved_changes = changes
            self.announce("model_saved", model=self._name, lessons=model.card.lessons)
            return self._name

    def _take(self) -> tuple[Model, int]:
        """Copy the learner between two turns; with it the count of changes that it holds."""

        def take() -> tuple[Model, int]:
            history = self._loop.history
            model = take_model(
                history.policy,
                history.taught,
                saved_at_s=time.time(),
                place=self._place,
                with_preview=False,
            )
            return model, history.changes

        model, changes = self._loop.submit(take).result(timeout=10.0)
        return with_preview(model), changes

    def load_last(self, learner: str | None = None) -> str | None:
        """Load the model used last, or the newest good one; None if there is none.

        Args:
            learner: Only a model of this learner will do; None for any.
        """
        for name, model in self.store.good_models():
            fits = learner in (None, model.card.learner) and self._moves >= set(model.card.moves)
            if fits:
                self._use(name, model)
                return name
        return None

    def load(self, name: str) -> None:
        """Save the model in use, and go on with another.

        Raises:
            RecordingError: If there is none, or it cannot be read.
            ConfigurationError: If the robot is not stopped.
        """
        with self._lock:
            self.save_if_changed()
            model = self.store.load(name)
            impossible = set(model.card.moves) - self._moves
            if impossible:
                moves = ", ".join(sorted(impossible))
                raise ConfigurationError(f"this robot cannot {moves}, as the model {name!r} wants")
            self._use(name, model)

    def begin(
        self,
        name: str | None = None,
        learner: str | None = None,
        place: str | None = None,
        moves: tuple[Action, ...] | None = None,
    ) -> str:
        """Save the model in use, and begin an empty one; return its name."""
        with self._lock:
            self.save_if_changed()
            policy = make_policy(
                learner or self._loop.state.learner, moves or self._loop.state.moves
            )
            place = self._place if place is None else place
            model = take_model(policy, Counter(), saved_at_s=time.time(), place=place)
            new_name = self.store.free_name(name or self._wanted_name)
            self._use(new_name, model)
            return self.save()

    def _use(self, name: str, model: Model) -> None:
        """Have the loop go on with this model, between two turns and only while it stands."""
        policy, taught = model.to_policy(), Counter(model.card.taught)

        def replace() -> int:
            if self._loop.mode is not Mode.STOPPED:
                raise ConfigurationError("stop the robot before you change its model")
            self._loop.history.replace_policy(policy, taught)
            return self._loop.history.changes

        self._saved_changes = self._loop.submit(replace).result(timeout=10.0)
        self._name, self._place = name, model.card.place
        if name in self.store.names():
            self.store.current = name
        self.announce("model_loaded", model=name)

    def rename(self, name: str, new_name: str) -> str:
        """Rename a model, also the one in use."""
        with self._lock:
            kept = self.store.rename(name, new_name)
            if self._name == name:
                self._name = kept
            return kept

    def set_place(self, name: str, place: str) -> None:
        """Write down where a model was taught."""
        with self._lock:
            if self._name == name:
                self._place = place.strip()[:200]
                self.save()
            else:
                self.store.set_place(name, place)

    def delete(self, name: str) -> str:
        """Delete a model; of the one in use the robot keeps what it knows, under a new name."""
        with self._lock:
            key = self.store.delete(name)
            if self._name == name:
                self._name, self._saved_changes = None, self._loop.history.changes
            return key
