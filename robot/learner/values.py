"""Readers of the plain values in a policy's state: each reader checks one kind of value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

LARGEST, WHOLE = 1e12, 2**53
MOST_NAMES = 10_000
"""Maximum number of names; no body has that many moves."""

Names = Mapping[str, str]
"""The names of labels and moves that a model may use, each with the robot's own name for it. An
empty map allows every name."""
Reader = Callable[[Any, Names], Any]
"""Converts a plain value to the part's form, or raises ValueError if it is invalid."""


def demand(holds: bool, otherwise: str = "") -> None:
    """Raise ValueError unless `holds` is true."""
    if not holds:
        raise ValueError(otherwise)


def number(low: float = -LARGEST, high: float = LARGEST) -> Reader:
    """Read a finite number within bounds."""

    def read(plain: Any, names: Names) -> float:
        demand(isinstance(plain, int | float) and not isinstance(plain, bool))
        demand(low <= plain <= high)
        return float(plain)

    return read


def count(high: int = WHOLE) -> Reader:
    """Read an integer from 0 to `high`."""

    def read(plain: Any, names: Names) -> Any:
        demand(isinstance(plain, int) and not isinstance(plain, bool) and 0 <= plain <= high)
        return plain

    return read


def flag(plain: Any, names: Names) -> bool:
    """Read True or False."""
    demand(isinstance(plain, bool))
    return bool(plain)


def name(plain: Any, names: Names) -> str:
    """Read one of the model's names."""
    demand(isinstance(plain, str) and plain != "" and (not names or plain in names))
    return names.get(plain, plain)


def optional(reader: Reader) -> Reader:
    """Read None, or a value that `reader` accepts."""
    return lambda plain, names: None if plain is None else reader(plain, names)


def many(reader: Reader, most: int = MOST_NAMES, least: int = 0) -> Reader:
    """Read a list of `least` to `most` values of one kind."""

    def read(plain: Any, names: Names) -> list[Any]:
        demand(isinstance(plain, list | tuple) and least <= len(plain) <= most)
        return [reader(value, names) for value in plain]

    return read


def row(*readers: Reader) -> Reader:
    """Read a list with one value for each reader."""

    def read(plain: Any, names: Names) -> list[Any]:
        demand(isinstance(plain, list | tuple) and len(plain) == len(readers))
        return [reader(value, names) for reader, value in zip(readers, plain, strict=True)]

    return read


def table(key: Reader, value: Reader) -> Reader:
    """Read a table of keys and values."""

    def read(plain: Any, names: Names) -> dict[Any, Any]:
        demand(isinstance(plain, Mapping))
        return {key(k, names): value(v, names) for k, v in plain.items()}

    return read
