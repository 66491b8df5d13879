"""Validates a model from an untrusted source before it is used.

What it says of itself, of its learner and of its policy is compared with what a learner of that
kind keeps (`array_form.py`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import ConfigurationError, MissingExtraError, RecordingError
from robot.learner.base import State
from robot.policy.calibration import Calibration
from robot.policy.light import LightAdaptation
from robot.policy.move_context import MoveContext
from robot.policy.move_kinds import MoveKinds
from robot.policy.pilot_pace import PilotPace
from robot.policy.registry import MOST_NODES, split_name
from robot.store.models.array_form import MOST_VIEWS, check_arrays, describe_form
from robot.store.models.demands import (
    check_keys,
    check_like,
    check_plain,
    demand,
    is_count,
    is_number,
)
from robot.store.models.model import Model
from robot.types import Action

_MOST_MOVES, _MOST_PLACES = 32, 16
_PREVIEW_PX = 512
_FIXED = frozenset({"group_cost", "n_voters"})
_PLACE = re.compile(r"place(\d{1,2})_(.+)", re.ASCII)


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
    demand(number <= MOST_NODES, f"{summary.learner!r} has more than {MOST_NODES} images")
    moves = tuple(summary.moves)
    demand(0 < len(moves) <= _MOST_MOVES, "it names no moves, or too many")
    demand(len(set(moves)) == len(moves) and Action.STOP not in moves, "its moves are not unique")
    demand(set(summary.taught) <= set(moves), "it was taught moves that it does not name")
    demand(all(is_count(n) for n in summary.taught.values()), "a count of examples is invalid")
    demand(is_count(summary.n_nodes), "its number of images is not a count")
    demand(math.isfinite(summary.saved_at_s), "its time is not finite")
    _check_preview(model.preview)
    state = model.state
    demand(isinstance(state.params, dict), "it has no parameters")
    labels = [str(label) for label in state.labels]
    demand(set(labels) <= set(map(str, moves)), "it has labels that are not among its moves")
    form = describe_form(kind, moves, _n_labels(state, labels))
    demand(state.kind == form.kind, f"it is a {state.kind[:40]!r}, not a {form.kind!r}")
    _check_policy_params(state.params, form.params, summary.learner, moves)
    if state.kind == "policy:multi-place":
        _check_places(state, kind, moves, number)
    else:
        check_arrays(state.arrays, form.arrays, number, len(labels))
        _check_cluster(state.params["learner"], state.arrays, "", len(labels), number)
        _check_learner_params(state.params["learner"], form.params["learner"], number)


def _n_labels(state: State, labels: list[str]) -> int:
    """Return how many labels the arrays have columns for; in a baseline, one for each example."""
    if "xs" not in state.arrays and state.kind != "policy:multi-place":
        demand(len(set(labels)) == len(labels), "a label is there twice")
    return min(len(set(labels)), _MOST_MOVES)


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
    demand(is_count(size) and size <= number, f"{prefix}size is {size!r}")
    demand(is_count(next_id) and next_id >= size, f"{prefix}next_id is {next_id!r}")
    ids, counts = arrays["cluster_ids"][:size], arrays["cluster_counts"][:size]
    demand(len(np.unique(ids)) == size, f"{prefix}two images have one id")
    demand(size == 0 or int(ids.max()) < next_id, f"{prefix}an id is above next_id")
    demand(size == 0 or int(counts.min()) > 0, f"{prefix}an image stands for no frame")
    demand((size > 0) == (n_labels > 0), f"{prefix}it has images without labels, or labels alone")
    demand(int(arrays["cluster_pinned"].sum()) <= max(number - 1, 0), f"{prefix}all are pinned")
    if "cluster_groups" in arrays:
        groups = arrays["cluster_groups"][:size]
        demand(size == 0 or int(groups.max()) < n_labels, f"{prefix}an image has no such label")
    taken_up = arrays.get("taken_up")
    known = taken_up is None or int(taken_up[-1]) <= n_labels
    demand(known, f"{prefix}the last label is not known")
    votes = arrays["histograms"][:size].sum(axis=1)
    demand(size == 0 or int(votes.min()) > 0, f"{prefix}an image has no votes")


def _check_places(state: State, kind: str, moves: tuple[Action, ...], number: int) -> None:
    """Check a learner of several places: each is a learner of its own."""
    params = state.params["learner"]
    places = params["places"]
    demand(isinstance(places, list) and len(places) <= _MOST_PLACES, "it has too many places")
    by_place: list[dict[str, NDArray[Any]]] = [{} for _ in places]
    rest: dict[str, NDArray[Any]] = {}
    for name, array in state.arrays.items():
        match = _PLACE.fullmatch(name)
        if match and int(match[1]) < len(places):
            by_place[int(match[1])][match[2]] = array
        else:
            rest[name] = array
    pending = params["pending"]
    demand(isinstance(pending, list) and len(pending) <= _MOST_MOVES, "too many pending examples")
    demand(set(map(str, pending)) <= set(map(str, moves)), "a pending example has no label")
    size = describe_form(kind, moves, 1).params["learner"]["size"]
    if pending:
        waiting = rest.pop("pending")
        demand(
            waiting.dtype.str in ("|u1", "<f4") and waiting.shape == (len(pending), size), "pending"
        )
        demand(bool(np.isfinite(waiting).all()), "a pending example is not finite")
    demand(rest.keys() <= {"pace_picture"}, f"an array {sorted(rest)[:1]} does not belong there")
    demand(params["size"] == (size if places else None), "its vectors have another length")
    demand(is_count(params["n_seen"]), "n_seen is not a count")
    place = params["place"]
    demand(place is None or (is_count(place) and place < len(places)), "its place is unknown")
    for i, own in enumerate(by_place):
        described = places[i]
        labels = [str(label) for label in described["labels"]]
        demand(set(labels) <= set(map(str, moves)), "it has labels that are not among its moves")
        demand(0 < len(set(labels)) == len(labels), "a label is there twice")
        form = describe_form(kind, moves, len(labels))
        [pattern] = form.params["learner"]["places"]
        demand(described["kind"] == pattern["kind"], f"place {i} is of another kind")
        demand(is_count(described["n_added"]), f"place {i} has no count of views")
        arrays = {
            name.removeprefix("place0_"): shape
            for name, shape in form.arrays.items()
            if name.startswith("place0_")
        }
        check_arrays(own, arrays, number, len(labels), f"place{i}_")
        demand(len(own["views"]) == min(described["n_added"], MOST_VIEWS), "views are missing")
        _check_cluster(described["params"], own, f"place{i}_", len(labels), number)
        _check_learner_params(described["params"], pattern["params"], number)


def _check_policy_params(
    params: Mapping[str, Any], form: Mapping[str, Any], name: str, moves: tuple[Action, ...]
) -> None:
    check_keys(params, form, "the policy")
    demand(params["name"] == name, "it says two names of its learner")
    demand(is_count(params["lessons"]), "its number of examples is not a count")
    last_taught = params["last_taught"]
    demand(isinstance(last_taught, dict), "last_taught is not a table")
    for node, at in last_taught.items():
        demand(str(node).isascii() and str(node).isdecimal() and len(str(node)) < 17, "last_taught")
        demand(is_count(at), "last_taught holds no counts")
    last = params.get("last_learned")
    if last is not None:
        at_s, label = last
        demand(is_number(at_s) and str(label) in map(str, moves), "last_learned is invalid")
    if "pace" in params:
        demand(isinstance(params["pace"], dict), "pace is not a table")
        pace = dict(params["pace"])
        for key in ("label", "turning"):  # version 0.2 had the second
            move = pace.pop(key, None)
            demand(move is None or move in map(str, moves), f"pace.{key} is no move")
        check_plain(pace, "pace")
        PilotPace(MoveKinds(moves)).set_state(params["pace"], {})
    if "calibration" in params:
        _check_calibration(params["calibration"], moves)
    if "kinds" in params:
        MoveKinds(moves).set_state(params["kinds"])
    if "context" in params:
        context = params["context"]
        check_like(context, MoveContext(MoveKinds(moves)).get_state(), "context")
        known = {None, *map(str, moves)}
        demand({context["move"], context["before"]} <= known, "its context is no move")
        MoveContext(MoveKinds(moves)).set_state(context)
    if "light" in params:
        check_like(params["light"], LightAdaptation().get_state(), "light")
        LightAdaptation().set_state(params["light"])


def _check_calibration(values: Any, moves: tuple[Action, ...]) -> None:
    check_keys(values, Calibration().get_state(), "the calibration")
    losses, average = values["losses"], values["average"]
    demand(isinstance(losses, list) and isinstance(average, Mapping), "the calibration is none")
    known = {None, *map(str, moves)}
    demand({values["label"], *average} <= known, "the calibration names other moves")
    numbers = [*losses, *average.values(), values["last_s"], values["left_s"]]
    demand(all(map(is_number, numbers)), "the calibration holds no numbers")
    demand(all(value >= 0 for value in [*losses, *average.values()]), "a number is below 0")
    Calibration().set_state(values)


def _check_learner_params(params: Mapping[str, Any], form: Mapping[str, Any], number: int) -> None:
    check_keys(params, form, "the learner")
    for key, pattern in form.items():
        if key == "cluster":
            check_keys(params[key], pattern, "the clustering")
            demand(params[key]["max_nodes"] == number, "max_nodes is another number")
            demand(
                all(params[key][name] == pattern[name] for name in _FIXED & pattern.keys()),
                "the clustering has other constants",
            )
        elif key in _FIXED:
            same = params[key] == pattern and type(params[key]) is type(pattern)
            demand(same, f"{key} is {params[key]!r}, not {pattern!r}")
        elif key == "n_neighbours":
            demand(params[key] == number, f"{key} is {params[key]!r}, not {number}")
        else:
            check_like(params[key], pattern, key)
    if "novelty" in params and "novelty" not in form:  # where version 0.1 has it
        demand(all(map(is_number, params["novelty"])) and len(params["novelty"]) == 3, "novelty")


def _check_preview(preview: NDArray[Any]) -> None:
    demand(
        preview.dtype == np.uint8
        and preview.ndim in (2, 3)
        and preview.shape[2:] in ((), (3,))
        and all(0 < side <= _PREVIEW_PX for side in preview.shape),
        "its preview is not a picture",
    )
