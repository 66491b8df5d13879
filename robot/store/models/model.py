"""A model: the state of a policy with a summary, and its conversion to bytes and back.

The file is a NumPy `.npz` without pickles: `meta.npy` contains JSON text as bytes, and each
`state.NAME.npy` contains an array of the learner. The JSON has a SHA-256 of the complete content.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import UNREADABLE, RecordingError, told_as
from robot.learner.base import State
from robot.policy.events import to_plain
from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.store.npz import read_arrays, write_arrays
from robot.types import Action

FORMAT = 1
MAX_BYTES = 256 * 2**20
"""Maximum size of a model, in bytes. A file that declares a larger size is not unpacked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JournalPosition:
    """The last journal entry that a model includes.

    Each start of the program has a random name, `run`, and a number, `boot`. `change` counts the
    changes of the learner since this start. The position does not depend on a clock.
    """

    run: str
    boot: int
    change: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSummary:
    """A model's entry in the list. `saved_at_s` is the wall-clock time in seconds since 1970.

    `position` is the last journal entry that the model includes; None without a journal.
    """

    learner: str
    moves: tuple[Action, ...]
    taught: Mapping[Action, int]
    n_nodes: int
    saved_at_s: float
    place: str = ""
    position: JournalPosition | None = None

    @property
    def n_examples(self) -> int:
        return sum(self.taught.values())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """The state of a policy, without the policy."""

    summary: ModelSummary
    state: State

    def to_policy(self) -> Policy:
        what = f"the model of the learner {self.summary.learner[:40]!r} cannot be opened"
        # The plugin of a learner may raise any error.
        with told_as(RecordingError, what, Exception):
            policy = make_policy(self.summary.learner, self.summary.moves)
            policy.set_state(self.state)
        return policy


def take_model(
    policy: Policy,
    taught: Mapping[Action, int],
    *,
    saved_at_s: float = 0.0,
    place: str = "",
    position: JournalPosition | None = None,
) -> Model:
    """Copy the state of a policy. Call this function on the policy's thread."""
    summary = ModelSummary(
        learner=policy.name,
        moves=tuple(policy.moves),
        taught={action: count for action, count in taught.items() if count},
        n_nodes=policy.n_nodes,
        saved_at_s=saved_at_s,
        place=place,
        position=position,
    )
    return Model(summary=summary, state=policy.get_state())


def encode_model(model: Model, *, is_packed: bool = False) -> bytes:
    """Return the bytes of an `.npz` file; `is_packed` compresses it, which takes longer."""
    state = model.state
    arrays = {f"state.{name}": array for name, array in state.arrays.items()}
    labels = [str(label) for label in state.labels]
    meta: dict[str, Any] = {"format": FORMAT, **asdict(model.summary)}
    meta["journal"] = meta.pop("position")
    meta["state"] = {"kind": state.kind, "params": state.params, "labels": labels}
    meta["sha256"] = _checksum(meta, arrays)
    text = json.dumps(meta, ensure_ascii=False, default=to_plain).encode()
    return write_arrays({"meta": np.frombuffer(text, np.uint8), **arrays}, is_packed=is_packed)


def decode_model(data: bytes, *, max_bytes: int = MAX_BYTES) -> Model:
    """Read a model from the bytes of its file; its arrays are read-only views of these bytes.
    Raises RecordingError if the model is damaged, malicious, too large, or in a newer format."""
    arrays = _unpack(data, max_bytes)
    meta = _read_meta(arrays.pop("meta", None))
    if meta.get("sha256") != _checksum(meta, arrays):
        raise RecordingError("the model is damaged: its checksum does not match")
    with told_as(RecordingError, "the model's description is damaged", *UNREADABLE):
        described = meta["state"]
        if not isinstance(described["labels"], list):
            raise ValueError("the model's labels are not a list")
        state = State(
            kind=str(described["kind"]),
            params=dict(described["params"]),
            arrays={
                n.removeprefix("state."): a for n, a in arrays.items() if n.startswith("state.")
            },
            labels=[_label(str(label)) for label in described["labels"]],
        )
    return Model(summary=_summary(meta), state=state)


def decode_summary(data: bytes) -> ModelSummary:
    """Read only the summary and do not check the arrays; raises the errors of `decode_model`."""
    return _summary(_read_meta(_unpack(data, MAX_BYTES, "meta").get("meta")))


def stamp(model: Model, **changes: Any) -> Model:
    """Return the model with new values in its summary, such as another time or place."""
    return replace(model, summary=replace(model.summary, **changes))


def same_nodes(a: State, b: State) -> bool:
    """True if all arrays and labels of two learners are equal, bit for bit."""

    def digest(state: State) -> str:
        labels = list(map(str, state.labels))
        return _checksum({"kind": state.kind, "labels": labels}, state.arrays)

    return digest(a) == digest(b)


def _label(text: str) -> str:
    """Return a label with its original type, so that a loaded state equals the saved one."""
    try:
        return Action(text)
    except ValueError:
        return text


def _checksum(meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Hash `meta` without its own hash, and all arrays with their names, types and shapes."""
    plain = {key: value for key, value in meta.items() if key != "sha256"}
    digest = hashlib.sha256(json.dumps(plain, sort_keys=True, default=to_plain).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {arrays[name].shape}".encode())
        digest.update(array.reshape(-1).view(np.uint8).data if array.size else b"")
    return digest.hexdigest()


def _unpack(data: bytes, max_bytes: int, only: str | None = None) -> dict[str, NDArray[Any]]:
    with told_as(RecordingError, "this is not a model, or it is damaged", RecordingError):
        return read_arrays(data, max_bytes=max_bytes, only=only)


def _read_meta(raw: NDArray[Any] | None) -> dict[str, Any]:
    with told_as(RecordingError, "this is not a model, or it is damaged", *UNREADABLE):
        if raw is None or raw.dtype != np.uint8:
            raise ValueError("the model has no metadata")
        meta = json.loads(raw.tobytes())
        # A lone surrogate can be neither shown nor sent.
        json.dumps(meta, ensure_ascii=False).encode()
        is_known = isinstance(meta["format"], int) and meta["format"] >= 1
        if not is_known or not isinstance(meta["state"]["params"], dict):
            raise ValueError("the model's metadata has an unknown form")
    if meta["format"] > FORMAT:
        raise RecordingError(
            f"this model has format {meta['format']}, but this version reads formats up to "
            f"{FORMAT}; upgrade Drivelesson"
        )
    return dict(meta)


def _summary(meta: dict[str, Any]) -> ModelSummary:
    with told_as(RecordingError, "the model's description is damaged", *UNREADABLE):
        return ModelSummary(
            learner=str(meta["learner"]),
            moves=tuple(Action(move) for move in meta["moves"]),
            taught={Action(action): _count(count) for action, count in meta["taught"].items()},
            n_nodes=_count(meta["n_nodes"]),
            saved_at_s=_finite(float(meta["saved_at_s"])),
            place=str(meta["place"])[:200],
            position=_position(meta.get("journal")),
        )


def _finite(number: float) -> float:
    if not math.isfinite(number):
        raise ValueError("the model's time is not finite")
    return number


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**48:
        raise ValueError(f"{str(value)[:20]!r} is not a count")
    return value


def _position(plain: Any) -> JournalPosition | None:
    if plain is None:
        return None
    return JournalPosition(
        run=str(plain["run"]), boot=_count(plain["boot"]), change=_count(plain["change"])
    )
