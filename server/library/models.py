"""Renames, copies and restores the models of one robot; the core only saves and loads models."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError
from robot.learner.base import State
from robot.policy.policy import Policy
from robot.store.folder import Storage, check_name, fold, paths_in, size_of
from robot.store.models.autosave import Autosave
from robot.store.models.model import ModelSummary, decode_model, stamp
from robot.store.models.store import ModelStore

MOST_EARLIER = 8
"""Maximum number of earlier models whose weights a new model can use. Each model takes time to
load."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredModel:
    """One model in the list; `summary` is None if no version of the model can be read."""

    name: str
    summary: ModelSummary | None
    bytes: int
    is_current: bool
    damaged: tuple[str, ...]


class ModelLibrary:
    """The models in a data folder. `autosave` saves the model in use; None if no model is in
    use."""

    def __init__(
        self, storage: Storage, store: ModelStore, autosave: Autosave | None = None
    ) -> None:
        self._storage, self._store, self._autosave = storage, store, autosave

    def saved(self) -> list[StoredModel]:
        """List all models, the newest first."""
        store, current = self._store, self._store.current
        saved = [
            StoredModel(
                name=name,
                summary=store.summary(name),
                bytes=sum(map(size_of, store.versions(name)[-1:])),
                is_current=name == current,
                damaged=tuple(store.aside(name)),
            )
            for name in store.names()
        ]
        return sorted(saved, key=lambda s: -s.summary.saved_at_s if s.summary else 0.0)

    def rename(self, name: str, new_name: str) -> str:
        """Rename a model; return the new name as it was saved."""
        if self._autosave is None:
            return self._rename(name, new_name)
        with self._autosave.lock:
            kept = self._rename(name, new_name)
            if self._autosave.name == name:
                self._autosave.name = kept
            return kept

    def _rename(self, name: str, new_name: str) -> str:
        store, folder = self._store, self._storage.models
        was_current = store.current == store.require(name)
        new_name = check_name(new_name)
        others = {path.name for path in paths_in(folder)} - {name}
        if fold(new_name) in set(map(fold, others)):
            raise ConfigurationError(f"there is already a model {new_name!r}")
        (folder / name).rename(folder / new_name)
        if was_current:
            try:
                store.current = new_name
            except OSError:  # rename the folder back, so that the old name stays valid
                with contextlib.suppress(OSError):
                    (folder / new_name).rename(folder / name)
                with contextlib.suppress(OSError):
                    store.current = name
                raise
        return new_name

    def set_place(self, name: str, place: str) -> None:
        """Set the place where a model was taught."""
        autosave, store, place = self._autosave, self._store, place.strip()
        if autosave is not None:
            with autosave.lock:
                if autosave.name == name:
                    autosave.save(place)
                    return
        store.save(name, stamp(store.load(name), place=place))

    def begin_like(self, policy: Policy, names: Sequence[str]) -> None:
        """Let a new policy begin with the weights of earlier models, which were taught at places
        that may resemble the new place.

        Raises:
            ConfigurationError: If a model does not exist or is of another kind, or there are more
                than `MOST_EARLIER`.
            RecordingError: If a model is damaged.
        """
        if len(names) > MOST_EARLIER:
            raise ConfigurationError(
                f"a new model can begin with at most {MOST_EARLIER} earlier models"
            )
        # `to_policy` checks the model, because an uploaded file can contain anything.
        states = [self._store.load(name).to_policy().get_state() for name in names]
        if begin_like(policy, states) < len(names):
            raise ConfigurationError(
                f"a new model of {policy.name} cannot start from {', '.join(names)}: all must "
                "have the same moves and the same learner, with a linear part"
            )

    def copy(self, name: str, new_name: str | None = None) -> str:
        """Copy a model; return the copy's name."""
        return self._store.add_file(new_name or name, self._store.read_file(name))

    def restore(self, key: str) -> str:
        """Restore a deleted model; return its name, which is new if the old name is in use."""
        [name] = self._storage.restore(key, self._storage.models)
        return name

    def preview(self, name: str) -> NDArray[np.uint8]:
        """Return a small grey picture of the learned image into which the most frames were merged.

        For a model without learned images, return one black pixel.
        """
        policy = decode_model(self._store.read_file(name)).to_policy()
        nodes = policy.learner.nodes()
        if not nodes:
            return np.zeros((1, 1), np.uint8)
        return policy.features.thumbnail(max(nodes, key=lambda node: node.frames).image)


def begin_like(policy: Policy, earlier: Sequence[State]) -> int:
    """Begin with the weights of earlier policies; return how many of these policies were used.

    From the first example on, the learner also uses the weights of the earlier policies, but its
    own examples count more. Call this before the first example.

    Args:
        policy: The policy that begins.
        earlier: States of policies (`Policy.get_state`). States of other kinds of learners are
            ignored, and so are states with moves that the policy does not have.
    """
    usable = [
        replace(state, kind=state.kind.removeprefix("policy:"))
        for state in earlier
        if set(state.labels) <= set(policy.moves)
    ]
    return policy.learner.begin_like(usable)
