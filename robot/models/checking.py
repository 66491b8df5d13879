"""Validates a model from an untrusted source before it is used.

The expected arrays of each learner are not listed here a second time: two small learners of the
same kind are made and compared. A dimension that differs between them grows with the nodes.

One file because every check is part of one pass through the metadata.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError, MissingExtraError, RecordingError
from robot.learner.base import State
from robot.models.model import Model
from robot.policy.calibration import Calibration
from robot.policy.light import LightAdaptation
from robot.policy.move_context import MoveContext
from robot.policy.pilot_pace import PilotPace
from robot.policy.policy import Policy
from robot.policy.registry import MOST_NODES, make_policy, split_name
from robot.types import Action, Encoding, Frame

_MOST_MOVES, _MOST_PLACES, _MOST_VIEWS, _MOST_EXAMPLES = 32, 16, 128, 200_000
_LARGEST, _LARGEST_WEIGHT = 1e12, 1e24
_WHOLE = 2**53
_PREVIEW_PX = 512
_SMALL, _LARGE = 2, 3
_OPTIONAL = frozenset(
    {
        *("touched", "novelty", "runs", "contrary", "pace_picture"),
        *("last_learned", "pace", "calibration", "light", "context"),
    }
)
"""What models of version 0.1 do not have, or have elsewhere."""
_LATER = frozenset({"triangle", "waiting"})
"""What models from before contexts have as one array, `inverse`."""
_LEAST_NOVELTY, _MOST_NOVELTY = 3, 100_000
_SIGNED = frozenset({"linear", "residual"})
_FIXED = frozenset({"group_cost", "n_voters"})
_PLACE = re.compile(r"place(\d{1,2})_(.+)", re.ASCII)
_EXAMPLES, _VIEWS = -1, -2
"""Sides that go with the number of examples, and of views of a place."""

Shape = tuple[int | str, ...]
Form = dict[str, tuple[str, tuple[Any, ...]]]
"""Arrays by name: dtype, and sides; `+k` is the number of nodes and k more."""


def check_model(model: Model) -> None:
    """Refuse an invalid model. Allocates nothing of a size that the model claims.

    Raises:
        RecordingError: If an array, a parameter or a label is missing, of another form or out of
            range; says which.
    """
    try:
        _check(model)
    except RecordingError:
        raise
    except (ConfigurationError, MissingExtraError) as error:
        raise RecordingError(f"the model cannot be used here: {str(error)[:200]}") from error
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise RecordingError(f"the model's description is damaged: {repr(error)[:200]}") from error


def _check(model: Model) -> None:
    summary = model.summary
    kind, number = split_name(summary.learner)
    _demand(number <= MOST_NODES, f"{summary.learner!r} has more than {MOST_NODES} images")
    moves = tuple(summary.moves)
    _demand(0 < len(moves) <= _MOST_MOVES, "it names no moves, or too many")
    _demand(len(set(moves)) == len(moves) and Action.STOP not in moves, "its moves are not unique")
    _demand(set(summary.taught) <= set(moves), "it was taught moves that it does not name")
    _demand(all(_is_count(n) for n in summary.taught.values()), "a count of examples is invalid")
    _demand(_is_count(summary.n_nodes), "its number of images is not a count")
    _demand(math.isfinite(summary.saved_at_s), "its time is not finite")
    _check_preview(model.preview)
    state = model.state
    _demand(isinstance(state.params, dict), "it has no parameters")
    labels = [str(label) for label in state.labels]
    _demand(set(labels) <= set(map(str, moves)), "it has labels that are not among its moves")
    form = describe_form(kind, moves, _n_labels(state, labels))
    _demand(state.kind == form.kind, f"it is a {state.kind[:40]!r}, not a {form.kind!r}")
    _check_policy_params(state.params, form.params, summary.learner, moves)
    if state.kind == "policy:multi-place":
        _check_places(state, kind, moves, number)
    else:
        _check_arrays(state.arrays, form.arrays, number, len(labels))
        _check_cluster(state.params["learner"], state.arrays, "", len(labels), number)
        _check_learner_params(state.params["learner"], form.params["learner"], number)


def _n_labels(state: State, labels: list[str]) -> int:
    """Return how many labels the arrays have columns for; in a baseline, one for each example."""
    if "xs" not in state.arrays and state.kind != "policy:multi-place":
        _demand(len(set(labels)) == len(labels), "a label is there twice")
    return min(len(set(labels)), _MOST_MOVES)


class _Described:
    """What a learner of some kind keeps."""

    def __init__(self, kind: str, params: dict[str, Any], arrays: Form) -> None:
        self.kind, self.params, self.arrays = kind, params, arrays


@lru_cache(maxsize=64)
def describe_form(kind: str, moves: tuple[Action, ...], n_labels: int) -> _Described:
    """Return what a learner of this kind keeps after it was taught so many different labels."""
    small, large = (_taught(f"{kind}-{n}", moves, n_labels) for n in (_SMALL, _LARGE))
    one, other = small.get_state(), large.get_state()
    arrays: Form = {}
    for name, array in one.arrays.items():
        sides: list[Any] = []
        for a, b in zip(array.shape, other.arrays[name].shape, strict=True):
            sides.append(a if a == b else f"+{a - _SMALL}")
        if name == "xs":
            sides[0] = _EXAMPLES
        if name.endswith("_views"):
            sides[0] = _VIEWS
        arrays[name] = (array.dtype.str, tuple(sides))
    return _Described(one.kind, one.params, arrays)


def _taught(name: str, moves: tuple[Action, ...], n_labels: int) -> Policy:
    policy = make_policy(name, moves)
    black = Frame(
        frame_id=1,
        captured_s=0.0,
        width=160,
        height=120,
        encoding=Encoding.RGB,
        data=bytes(160 * 120 * 3),
    )
    x = policy.extract(black)
    for i, label in enumerate(moves[:n_labels]):
        policy.learn(x, label, float(i))
    for step in range(3 if n_labels else 0):  # until contexts differ
        policy.learn(x, moves[n_labels - 1], n_labels - 0.7 + 0.3 * step)
    return policy


def _check_arrays(
    arrays: Mapping[str, NDArray[Any]], form: Form, number: int, n_examples: int, prefix: str = ""
) -> None:
    """Check every array against the form: none missing, none more, each of its dtype and shape."""
    optional = {name for name in form if name.startswith("context")}
    if optional & arrays.keys():  # all of it is there, or nothing
        optional = set()
    if not any(name.endswith("_block_frames") for name in arrays):  # contexts before blocks
        optional |= {name for name in form if "_block_" in name}
    if form.keys() >= _LATER and not _LATER & arrays.keys():
        optional |= _LATER
        form = {**form, "inverse": (form["triangle"][0], (form["waiting"][1][1],) * 2)}
    for name in sorted(form.keys() - arrays.keys() - optional):
        _demand(name.removeprefix("cluster_") in _OPTIONAL, f"the array {prefix}{name} is missing")
    for name in sorted(arrays.keys() - form.keys()):
        _demand(name == "pace_picture", f"an array {(prefix + name)[:60]!r} does not belong there")
    for name, array in arrays.items():
        if name not in form:
            _demand(array.dtype == np.uint8 and array.ndim == 1, "the array pace_picture is none")
            continue
        dtype, sides = form[name]
        what = f"the array {prefix}{name}"
        if name == "novelty":  # as long as its history is
            _demand(array.dtype == np.float64 and array.ndim == 1, f"{what} is none")
            _demand(_LEAST_NOVELTY <= array.size <= _MOST_NOVELTY, f"{what} has another length")
            _check_values(array, name, what)
            continue
        is_wider = _is_wider(array.dtype, np.dtype(dtype))
        fits = array.dtype.str == dtype or is_wider
        _demand(fits, f"{what} is of {array.dtype.str}, not of {dtype}")
        _demand(array.ndim == len(sides), f"{what} has the shape {array.shape}")
        for side, length in zip(sides, array.shape, strict=True):
            if side == _VIEWS:
                _demand(length <= _MOST_VIEWS, f"{what} has the shape {array.shape}")
            else:
                wanted = (
                    n_examples
                    if side == _EXAMPLES
                    else number + int(side)
                    if isinstance(side, str)
                    else side
                )
                _demand(length == wanted, f"{what} has the shape {array.shape}")
        _check_values(array, name, what)
        if is_wider and array.size:
            most = int(np.iinfo(dtype).max)
            _demand(int(array.max()) <= most, f"{what} holds {int(array.max())}")


def _is_wider(dtype: np.dtype[Any], wanted: np.dtype[Any]) -> bool:
    """True for int64 where fewer bits are enough today: version 0.1 had nothing else."""
    return dtype == np.int64 and wanted.kind in "iu" and wanted != np.uint8


def _check_values(array: NDArray[Any], name: str, what: str) -> None:
    if array.size == 0:
        return
    if array.dtype.kind == "f":
        low, high = float(array.min()), float(array.max())
        _demand(not math.isnan(low) and not math.isnan(high), f"{what} holds NaN")
        most = _LARGEST
        if name.endswith("weights"):  # infinite where there is no edge
            most = _LARGEST_WEIGHT
            high = float(array.max(where=array < np.inf, initial=0.0))
        _demand(low >= -_LARGEST, f"{what} holds {low:g}")
        _demand(high <= most, f"{what} holds {high:g}")
        if name.endswith("norms"):
            _demand(low >= 0.0, f"{what} holds {low:g}")
    elif array.dtype.kind == "i":
        low, high = int(array.min()), int(array.max())
        least = -_WHOLE if name in _SIGNED else 0
        _demand(low >= least and high <= _WHOLE, f"{what} holds {low if low < least else high}")


def _check_cluster(
    params: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]],
    prefix: str,
    n_labels: int,
    number: int,
) -> None:
    """Check what the clustering's arrays say of one another."""
    if "cluster" not in params:
        return
    size, next_id = params["cluster"]["size"], params["cluster"]["next_id"]
    _demand(_is_count(size) and size <= number, f"{prefix}size is {size!r}")
    _demand(_is_count(next_id) and next_id >= size, f"{prefix}next_id is {next_id!r}")
    ids, counts = arrays["cluster_ids"][:size], arrays["cluster_counts"][:size]
    _demand(len(np.unique(ids)) == size, f"{prefix}two images have one id")
    _demand(size == 0 or int(ids.max()) < next_id, f"{prefix}an id is above next_id")
    _demand(size == 0 or int(counts.min()) > 0, f"{prefix}an image stands for no frame")
    _demand((size > 0) == (n_labels > 0), f"{prefix}it has images without labels, or labels alone")
    _demand(int(arrays["cluster_pinned"].sum()) <= max(number - 1, 0), f"{prefix}all are pinned")
    if "cluster_groups" in arrays:
        groups = arrays["cluster_groups"][:size]
        _demand(size == 0 or int(groups.max()) < n_labels, f"{prefix}an image has no such label")
    runs = arrays.get("runs")
    _demand(runs is None or int(runs[1:].max()) <= n_labels, f"{prefix}runs have no such label")
    votes = arrays["histograms"][:size].sum(axis=1)
    _demand(size == 0 or int(votes.min()) > 0, f"{prefix}an image has no votes")


def _check_places(state: State, kind: str, moves: tuple[Action, ...], number: int) -> None:
    """Check a learner of several places: each is a learner of its own."""
    params = state.params["learner"]
    places = params["places"]
    _demand(isinstance(places, list) and len(places) <= _MOST_PLACES, "it has too many places")
    by_place: list[dict[str, NDArray[Any]]] = [{} for _ in places]
    rest: dict[str, NDArray[Any]] = {}
    for name, array in state.arrays.items():
        match = _PLACE.fullmatch(name)
        if match and int(match[1]) < len(places):
            by_place[int(match[1])][match[2]] = array
        else:
            rest[name] = array
    pending = params["pending"]
    _demand(isinstance(pending, list) and len(pending) <= _MOST_MOVES, "too many pending examples")
    _demand(set(map(str, pending)) <= set(map(str, moves)), "a pending example has no label")
    size = describe_form(kind, moves, 1).params["learner"]["size"]
    if pending:
        waiting = rest.pop("pending")
        _demand(
            waiting.dtype.str in ("|u1", "<f4") and waiting.shape == (len(pending), size), "pending"
        )
        _demand(bool(np.isfinite(waiting).all()), "a pending example is not finite")
    _demand(rest.keys() <= {"pace_picture"}, f"an array {sorted(rest)[:1]} does not belong there")
    _demand(params["size"] == (size if places else None), "its vectors have another length")
    _demand(_is_count(params["n_seen"]), "n_seen is not a count")
    place = params["place"]
    _demand(place is None or (_is_count(place) and place < len(places)), "its place is unknown")
    for i, own in enumerate(by_place):
        described = places[i]
        labels = [str(label) for label in described["labels"]]
        _demand(set(labels) <= set(map(str, moves)), "it has labels that are not among its moves")
        _demand(0 < len(set(labels)) == len(labels), "a label is there twice")
        form = describe_form(kind, moves, len(labels))
        [pattern] = form.params["learner"]["places"]
        _demand(described["kind"] == pattern["kind"], f"place {i} is of another kind")
        _demand(_is_count(described["n_added"]), f"place {i} has no count of views")
        arrays = {
            name.removeprefix("place0_"): shape
            for name, shape in form.arrays.items()
            if name.startswith("place0_")
        }
        _check_arrays(own, arrays, number, len(labels), f"place{i}_")
        _demand(len(own["views"]) == min(described["n_added"], _MOST_VIEWS), "views are missing")
        _check_cluster(described["params"], own, f"place{i}_", len(labels), number)
        _check_learner_params(described["params"], pattern["params"], number)


def _check_policy_params(
    params: Mapping[str, Any], form: Mapping[str, Any], name: str, moves: tuple[Action, ...]
) -> None:
    _check_keys(params, form, "the policy")
    _demand(params["name"] == name, "it says two names of its learner")
    _demand(_is_count(params["lessons"]), "its number of examples is not a count")
    last_taught = params["last_taught"]
    _demand(isinstance(last_taught, dict), "last_taught is not a table")
    for node, at in last_taught.items():
        _demand(
            str(node).isascii() and str(node).isdecimal() and len(str(node)) < 17, "last_taught"
        )
        _demand(_is_count(at), "last_taught holds no counts")
    last = params.get("last_learned")
    if last is not None:
        at_s, label = last
        _demand(_is_number(at_s) and str(label) in map(str, moves), "last_learned is invalid")
    if "pace" in params:
        _demand(isinstance(params["pace"], dict), "pace is not a table")
        pace = dict(params["pace"])
        turning = pace.pop("turning", None)
        _demand(turning is None or turning in map(str, moves), "pace.turning is no move")
        _check_plain(pace, "pace")
        PilotPace().set_state(params["pace"], {})
    if "calibration" in params:
        _check_calibration(params["calibration"], moves)
    if "context" in params:
        context = params["context"]
        _check_like(context, MoveContext().get_state(), "context")
        known = {None, *map(str, moves)}
        _demand({context["move"], context["before"]} <= known, "its context is no move")
        MoveContext().set_state(context)
    if "light" in params:
        _check_like(params["light"], LightAdaptation().get_state(), "light")
        LightAdaptation().set_state(params["light"])


def _check_calibration(values: Any, moves: tuple[Action, ...]) -> None:
    _check_keys(values, Calibration().get_state(), "the calibration")
    losses, average = values["losses"], values["average"]
    _demand(isinstance(losses, list) and isinstance(average, Mapping), "the calibration is none")
    known = {None, *map(str, moves)}
    _demand({values["label"], *average} <= known, "the calibration names other moves")
    numbers = [*losses, *average.values(), values["last_s"], values["left_s"]]
    _demand(all(map(_is_number, numbers)), "the calibration holds no numbers")
    _demand(all(value >= 0 for value in [*losses, *average.values()]), "a number is below 0")
    Calibration().set_state(values)


def _check_learner_params(params: Mapping[str, Any], form: Mapping[str, Any], number: int) -> None:
    _check_keys(params, form, "the learner")
    for key, pattern in form.items():
        if key == "cluster":
            _check_keys(params[key], pattern, "the clustering")
            _demand(params[key]["max_nodes"] == number, "max_nodes is another number")
            _demand(
                all(params[key][name] == pattern[name] for name in _FIXED & pattern.keys()),
                "the clustering has other constants",
            )
        elif key in _FIXED:
            same = params[key] == pattern and type(params[key]) is type(pattern)
            _demand(same, f"{key} is {params[key]!r}, not {pattern!r}")
        elif key == "n_neighbours":
            _demand(params[key] == number, f"{key} is {params[key]!r}, not {number}")
        else:
            _check_like(params[key], pattern, key)
    if "novelty" in params and "novelty" not in form:  # where version 0.1 has it
        _demand(all(map(_is_number, params["novelty"])) and len(params["novelty"]) == 3, "novelty")


def _check_keys(params: Any, form: Mapping[str, Any], what: str) -> None:
    _demand(isinstance(params, Mapping), f"{what} has no parameters")
    missing = form.keys() - params.keys() - _OPTIONAL
    _demand(not missing, f"{what} lacks {', '.join(sorted(missing))}")
    strange = params.keys() - form.keys() - _OPTIONAL
    _demand(
        not strange, f"{what} has strange parameters: {', '.join(sorted(map(str, strange)))[:80]}"
    )


def _check_like(value: Any, pattern: Any, what: str) -> None:
    """Check a plain value against one of the same kind: numbers finite, lists as long."""
    if isinstance(pattern, Mapping):
        _check_keys(value, pattern, what)
        for key in pattern.keys() & value.keys():
            _check_like(value[key], pattern[key], f"{what}.{key}")
    elif isinstance(pattern, list | tuple):
        _demand(isinstance(value, list | tuple) and len(value) == len(pattern), f"{what} is none")
        for one, other in zip(value, pattern, strict=True):
            _check_like(one, other, what)
    elif isinstance(pattern, int) and not isinstance(pattern, bool):
        _demand(_is_count(value), f"{what} is {value!r}")
    elif isinstance(pattern, float):
        _demand(_is_number(value), f"{what} is {value!r}")
    elif pattern is not None:
        _demand(type(value) is type(pattern), f"{what} is {value!r}")


def _check_plain(value: Any, what: str, depth: int = 0) -> None:
    """Allow tables, short lists, finite numbers and None, and nothing else."""
    _demand(depth < 5, f"{what} is nested too deeply")
    if isinstance(value, Mapping | list | tuple):
        _demand(len(value) <= 64, f"{what} is too long")
        for inner in value.values() if isinstance(value, Mapping) else value:
            _check_plain(inner, what, depth + 1)
    else:
        _demand(value is None or isinstance(value, bool) or _is_number(value), f"{what}: {value!r}")


def _check_preview(preview: NDArray[Any]) -> None:
    _demand(
        preview.dtype == np.uint8
        and preview.ndim in (2, 3)
        and preview.shape[2:] in ((), (3,))
        and all(0 < side <= _PREVIEW_PX for side in preview.shape),
        "its preview is not a picture",
    )


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _WHOLE


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= _LARGEST


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise RecordingError(f"the model is invalid: {otherwise}"[:300])
