"""Which arrays a learner of some kind keeps, and whether a model's arrays are such.

The arrays of each learner are not listed here a second time: two small learners of the same kind
are made and compared. A dimension that differs between them grows with the nodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot.policy.policy import Policy
from robot.policy.registry import make_policy
from robot.store.models.demands import GONE, LARGEST, OPTIONAL, WHOLE, demand
from robot.types import Action, Encoding, Frame

MOST_VIEWS = 128
_LARGEST_WEIGHT = 1e24
_SMALL, _LARGE = 2, 3
_LATER = frozenset({"triangle", "waiting"})
"""What models from before contexts have as one array, `inverse`."""
_LEAST_NOVELTY, _MOST_NOVELTY = 3, 100_000
_SIGNED = frozenset({"linear", "residual"})
_EXAMPLES, _VIEWS = -1, -2
"""Sides that go with the number of examples, and of views of a place."""

Side = int | str
Form = dict[str, tuple[str, tuple[Side, ...]]]
"""Arrays by name: dtype, and sides; `+k` is the number of nodes and k more."""


class LearnerForm(NamedTuple):
    """What a learner of some kind keeps."""

    kind: str
    params: dict[str, Any]
    arrays: Form


@lru_cache(maxsize=64)
def describe_form(kind: str, moves: tuple[Action, ...], n_labels: int) -> LearnerForm:
    """Return what a learner of this kind keeps after it was taught so many different labels."""
    small, large = (_taught(f"{kind}-{n}", moves, n_labels) for n in (_SMALL, _LARGE))
    one, other = small.get_state(), large.get_state()
    arrays: Form = {}
    for name, array in one.arrays.items():
        sides: list[Side] = []
        for a, b in zip(array.shape, other.arrays[name].shape, strict=True):
            sides.append(a if a == b else f"+{a - _SMALL}")
        if name == "xs":
            sides[0] = _EXAMPLES
        if name.endswith("_views"):
            sides[0] = _VIEWS
        arrays[name] = (array.dtype.str, tuple(sides))
    return LearnerForm(one.kind, one.params, arrays)


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


def check_arrays(
    arrays: Mapping[str, NDArray[Any]], form: Form, number: int, n_examples: int, prefix: str = ""
) -> None:
    """Check every array against the form: none missing, none more, each of its dtype and shape.

    Args:
        arrays: The model's arrays by name.
        form: What they should be like.
        number: How many images the learner keeps at most.
        n_examples: How many examples a learner that keeps them all has.
        prefix: What the arrays' names begin with in the model, for messages.
    """
    form, optional = _form_of_its_age(form, arrays)
    for name in sorted(form.keys() - arrays.keys() - optional):
        demand(name.removeprefix("cluster_") in OPTIONAL, f"the array {prefix}{name} is missing")
    for name in sorted(arrays.keys() - form.keys()):
        demand(
            name == "pace_picture" or name in GONE,
            f"an array {(prefix + name)[:60]!r} does not belong there",
        )
    for name, array in arrays.items():
        what = f"the array {prefix}{name}"
        if name in GONE:
            continue
        if name not in form:
            demand(array.dtype == np.uint8 and array.ndim == 1, f"{what} is none")
            continue
        dtype, sides = form[name]
        if name == "novelty":  # as long as its history is
            demand(array.dtype == np.float64 and array.ndim == 1, f"{what} is none")
            demand(_LEAST_NOVELTY <= array.size <= _MOST_NOVELTY, f"{what} has another length")
        else:
            _check_dtype(array, dtype, what)
            fits = array.ndim == len(sides) and all(
                _is_length(length, side, number, n_examples)
                for side, length in zip(sides, array.shape, strict=True)
            )
            demand(fits, f"{what} has the shape {array.shape}")
        _check_values(array, name, what)


def _form_of_its_age(form: Form, arrays: Mapping[str, NDArray[Any]]) -> tuple[Form, set[str]]:
    """Return the form of a model of that age, and the names that need not be in it."""
    optional = {name for name in form if name.startswith("context")}
    if optional & arrays.keys():  # all of it is there, or nothing
        optional = set()
    if not any(name.endswith("_block_frames") for name in arrays):  # contexts before blocks
        optional |= {name for name in form if "_block_" in name}
    if form.keys() >= _LATER and not _LATER & arrays.keys():
        optional |= _LATER
        form = {**form, "inverse": (form["triangle"][0], (form["waiting"][1][1],) * 2)}
    return form, optional


def _is_length(length: int, side: Side, number: int, n_examples: int) -> bool:
    if side == _VIEWS:
        return length <= MOST_VIEWS
    if side == _EXAMPLES:
        return length == n_examples
    return length == (number + int(side) if isinstance(side, str) else side)


def _check_dtype(array: NDArray[Any], dtype: str, what: str) -> None:
    """Check an array's dtype; version 0.1 had int64 where fewer bits are enough today."""
    if array.dtype.str == dtype:
        return
    wanted = np.dtype(dtype)
    is_wider = array.dtype == np.int64 and wanted.kind in "iu" and wanted != np.uint8
    demand(is_wider, f"{what} is of {array.dtype.str}, not of {dtype}")
    most = int(array.max(initial=0))
    demand(most <= np.iinfo(wanted).max, f"{what} holds {most}")


def _check_values(array: NDArray[Any], name: str, what: str) -> None:
    if array.size == 0:
        return
    if array.dtype.kind == "f":
        low, high = float(array.min()), float(array.max())
        demand(not math.isnan(low) and not math.isnan(high), f"{what} holds NaN")
        most = LARGEST
        if name.endswith("weights"):  # infinite where there is no edge
            most = _LARGEST_WEIGHT
            high = float(array.max(where=array < np.inf, initial=0.0))
        demand(low >= -LARGEST, f"{what} holds {low:g}")
        demand(high <= most, f"{what} holds {high:g}")
        if name.endswith("norms"):
            demand(low >= 0.0, f"{what} holds {low:g}")
    elif array.dtype.kind == "i":
        low, high = int(array.min()), int(array.max())
        least = -WHOLE if name in _SIGNED else 0
        demand(low >= least and high <= WHOLE, f"{what} holds {low if low < least else high}")
