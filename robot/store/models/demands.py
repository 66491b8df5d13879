"""Demands on plain values from an untrusted source: counts, numbers, keys, nesting."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.errors import RecordingError

LARGEST = 1e12
WHOLE = 2**53
OPTIONAL = frozenset(
    {
        *("touched", "novelty", "pace_picture"),
        *("contradicted", "contradicted_since", "taken_up"),
        *("last_learned", "pace", "calibration", "light", "context", "kinds"),
    }
)
"""What models of earlier versions do not have, or have elsewhere."""
GONE = frozenset({"runs", "contrary", "anew", "starts"})
"""Arrays of earlier versions that no learner keeps any more: they are skipped."""


def demand(holds: bool, otherwise: str) -> None:
    """Refuse the model with RecordingError unless this holds."""
    if not holds:
        raise RecordingError(f"the model is invalid: {otherwise}"[:300])


def is_count(value: Any) -> bool:
    """Tell whether a value is a whole number from 0 that a float holds exactly."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= WHOLE


def is_number(value: Any) -> bool:
    """Tell whether a value is a finite number of a size that can be computed with."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST


def check_keys(params: Any, form: Mapping[str, Any], what: str) -> None:
    """Check that a table has the keys of `form`: none missing, none more, but what is optional."""
    demand(isinstance(params, Mapping), f"{what} has no parameters")
    missing = form.keys() - params.keys() - OPTIONAL
    demand(not missing, f"{what} lacks {', '.join(sorted(missing))}")
    strange = params.keys() - form.keys() - OPTIONAL
    demand(
        not strange, f"{what} has strange parameters: {', '.join(sorted(map(str, strange)))[:80]}"
    )


def check_like(value: Any, pattern: Any, what: str) -> None:
    """Check a plain value against one of the same kind: numbers finite, lists as long."""
    if isinstance(pattern, Mapping):
        check_keys(value, pattern, what)
        for key in pattern.keys() & value.keys():
            check_like(value[key], pattern[key], f"{what}.{key}")
    elif isinstance(pattern, list | tuple):
        demand(isinstance(value, list | tuple) and len(value) == len(pattern), f"{what} is none")
        for one, other in zip(value, pattern, strict=True):
            check_like(one, other, what)
    elif isinstance(pattern, int) and not isinstance(pattern, bool):
        demand(is_count(value), f"{what} is {value!r}")
    elif isinstance(pattern, float):
        demand(is_number(value), f"{what} is {value!r}")
    elif pattern is not None:
        demand(type(value) is type(pattern), f"{what} is {value!r}")


def check_plain(value: Any, what: str, depth: int = 0) -> None:
    """Allow tables, short lists, finite numbers and None, and nothing else."""
    demand(depth < 5, f"{what} is nested too deeply")
    if isinstance(value, Mapping | list | tuple):
        demand(len(value) <= 64, f"{what} is too long")
        for inner in value.values() if isinstance(value, Mapping) else value:
            check_plain(inner, what, depth + 1)
    else:
        demand(value is None or isinstance(value, bool) or is_number(value), f"{what}: {value!r}")
