"""Plain values that a part of a policy may keep: each reader says what one may be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

LARGEST, WHOLE = 1e12, 2**53
MOST_NAMES = 10_000
"""More moves than a body has."""

Names = Mapping[str, str]
"""The labels or moves that a model may name, and what each is to its parts; empty: any."""
Reader = Callable[[Any, Names], Any]
"""Returns a plain value as a part keeps it; raises ValueError for what it cannot be."""


def demand(holds: bool, otherwise: str = "") -> None:
    """Raise ValueError unless this holds."""
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
    """Read a whole number from 0."""

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
    """Read this or None."""
    return lambda plain, names: None if plain is None else reader(plain, names)


def many(reader: Reader, most: int = MOST_NAMES, least: int = 0) -> Reader:
    """Read a list of `least` to `most` values of one kind."""

    def read(plain: Any, names: Names) -> list[Any]:
        demand(isinstance(plain, list | tuple) and least <= len(plain) <= most)
        return [reader(value, names) for value in plain]

    return read


def row(*readers: Reader) -> Reader:
    """Read a list of one value of each kind."""

    def read(plain: Any, names: Names) -> list[Any]:
        demand(isinstance(plain, list | tuple) and len(plain) == len(readers))
        return [reader(value, names) for reader, value in zip(readers, plain, strict=True)]

    return read


def table(key: Reader, value: Reader) -> Reader:
    """Read a table."""

    def read(plain: Any, names: Names) -> dict[Any, Any]:
        demand(isinstance(plain, Mapping))
        return {key(k, names): value(v, names) for k, v in plain.items()}

    return read
