"""Declares the state of a policy's part once, for saving, loading and checking.

A part lists its `fields`: arrays, and plain values that JSON can represent. A part may contain
other parts. `check` compares a part with its declaration and bounds, and calls `faults` to find
contradictions between fields. So the same rules apply to a loaded model and to a learner that has
just learned.

Example:
    >>> from robot.learner.values import count
    >>> class Counter(Stateful):
    ...     fields = (Value("n", count(), "n"),)
    ...     n = 3
    >>> Counter().save()
    ({'n': 3}, {})
    >>> Counter().load({"n": -1}, {})
    Traceback (most recent call last):
    ValueError: n is not valid: -1
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.learner.values import LARGEST, Names, Reader, demand

MOST_VALUES = 1e6
"""The largest allowed magnitude of a feature in a loaded model."""
MOST_DISTANCE = 1e20
"""Upper bound of the squared distance of two vectors whose values are within `MOST_VALUES`."""

Params = dict[str, Any]
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, slots=True)
class Value:
    """A plain value in a part's state.

    Attributes:
        name: The value's name in a model.
        read: Reads and checks the value.
        attribute: The part's attribute that holds the value, or a dotted path; if empty, `_name`.
        is_fixed: True if the value is set when the part is made; a model with another value is
            refused.
    """

    name: str
    read: Reader
    attribute: str = ""
    is_fixed: bool = False

    def save(self, part: Stateful) -> Any:
        """Return the part's value in a form that JSON can represent."""
        value = _get(part, self)
        if isinstance(value, Mapping):
            return {str(key): own for key, own in value.items()}
        if isinstance(value, np.ndarray):
            return value.tolist()
        return value if isinstance(value, str) or not isinstance(value, Iterable) else list(value)

    def load(self, part: Stateful, params: Params, names: Names) -> None:
        """Set the part's value from a model."""
        demand(self.name in params, f"{self.name} is missing")
        plain = params.pop(self.name)
        value = self._read(plain, names)
        demand(not self.is_fixed or value == _get(part, self), f"{self.name} does not fit: {plain}")
        if not self.is_fixed:
            _set(part, self, value)

    def check(self, part: Stateful) -> None:
        """Raise ValueError if the part's value would be refused by `load`."""
        self._read(self.save(part), {})

    def _read(self, plain: Any, names: Names) -> Any:
        try:
            return self.read(plain, names)
        except ValueError as error:
            raise ValueError(f"{self.name} is not valid: {str(plain)[:40]}") from error


Side = int | str | range


@dataclass(frozen=True, slots=True)
class Array:
    """An array in a part's state.

    Attributes:
        name: The array's name in a model.
        dtype: Type of the values, or a tuple of allowed types.
        shape: The length of each dimension: a number, a range, or the name of an attribute of the
            part. Any other name stands for a length that all arrays of a model share. `name+1`
            means this length plus 1.
        low: The smallest allowed value.
        high: The largest allowed value.
        attribute: The part's attribute that holds the array, or a dotted path; if empty, `_name`.
        is_optional: True if the array is omitted from the model when None or empty.
    """

    name: str
    dtype: type | tuple[type, ...]
    shape: tuple[Side, ...]
    low: float = 0.0
    high: float = LARGEST
    attribute: str = ""
    is_optional: bool = False

    def save(self, part: Stateful) -> NDArray[Any] | None:
        """Return a copy of the part's array, or None if there is no array to save."""
        value = _get(part, self)
        if value is None or (self.is_optional and np.size(value) == 0):
            return None
        return np.array(value, None if isinstance(self.dtype, tuple) else self.dtype)

    def load(self, part: Stateful, arrays: Arrays, sizes: dict[str, int]) -> None:
        """Set the part's array to a copy of the model's array."""
        array = arrays.pop(self.name, None)
        sides = [self._length(side, part, sizes) for side in self.shape]
        dtypes = self.dtype if isinstance(self.dtype, tuple) else (self.dtype,)
        demand(array is not None or self.is_optional, f"the array {self.name} is missing")
        if array is not None:
            self._fit(array, sides, sizes)
            named = f"{array.dtype.str}, not {np.dtype(dtypes[0]).str}"
            demand(array.dtype in dtypes, f"the array {self.name} has type {named}")
            array = array.copy()
        _set(part, self, array)

    def _fit(self, array: NDArray[Any], sides: list[int | None], sizes: dict[str, int]) -> None:
        fits = array.ndim == len(sides)
        for side, wanted, length in zip(self.shape, sides, array.shape, strict=False):
            if isinstance(side, range):
                fits = fits and length in side
            elif wanted is None:
                sizes[str(side)] = length
            else:
                fits = fits and length == wanted
        demand(fits, f"the array {self.name} has the wrong shape {array.shape}")

    def _length(self, side: Side, part: Stateful, sizes: Mapping[str, int]) -> int | None:
        if not isinstance(side, str):
            return side if isinstance(side, int) else None
        stem, _, more = side.partition("+")
        length: int | None = getattr(part, stem, sizes.get(stem))
        return None if length is None else length + int(more or 0)

    def check(self, part: Stateful) -> None:
        """Raise ValueError if a value of the part's array is out of bounds."""
        value = _get(part, self)
        array = np.zeros(0) if value is None else np.asarray(value)
        if not _is_within(array, self.low, self.high):
            bad = f"[{self.low:g}, {self.high:g}], not {array.min():g} to {array.max():g}"
            raise ValueError(f"the values of the array {self.name} must lie in {bad}")


def _is_within(array: NDArray[Any], low: float, high: float) -> bool:
    """Return whether all values are within bounds; NaN never is."""
    if not array.size or array.dtype == np.bool_:
        return True
    return bool(array.min() >= low and array.max() <= high)


def _get(part: Stateful, field: Value | Array) -> Any:
    return attrgetter(field.attribute or f"_{field.name}")(part)


def _set(part: Stateful, field: Value | Array, value: Any) -> None:
    owner, _, own = (field.attribute or f"_{field.name}").rpartition(".")
    setattr(attrgetter(owner)(part) if owner else part, own, value)


class Stateful:
    """Base class of objects whose state is kept between drives."""

    @property
    def fields(self) -> Sequence[Value | Array]:
        """The values and arrays of the state. Most subclasses replace this property by a tuple."""
        return ()

    def parts(self) -> Sequence[tuple[str, Stateful]]:
        """Return the parts that this part contains, with their names.

        The values of a part are saved in a table named after the part. The names of its arrays
        begin with the name of the part. A part with an empty name is saved among its owner's values
        and arrays.
        """
        return ()

    def prepare(self, arrays: Arrays) -> None:
        """Create the parts to which a model's arrays belong, before the arrays are loaded."""

    def restored(self) -> None:
        """Compute the derived values after loading."""

    def faults(self) -> Iterator[str]:
        """Yield a sentence for each contradiction between fields that are within bounds."""
        return iter(())

    def save(self) -> tuple[Params, Arrays]:
        """Return copies of the state: plain values, and arrays."""
        params: Params = {}
        arrays: Arrays = {}
        for field in self.fields:
            if isinstance(field, Value):
                params[field.name] = field.save(self)
            elif (array := field.save(self)) is not None:
                arrays[field.name] = array
        for own, part in self.parts():
            values, its_arrays = part.save()
            params.update({own: values} if own and values else values)
            arrays.update({_inner(own, key): array for key, array in its_arrays.items()})
        return params, arrays

    def load(
        self,
        params: Mapping[str, Any],
        arrays: Mapping[str, NDArray[Any]],
        names: Names | None = None,
        sizes: dict[str, int] | None = None,
    ) -> None:
        """Restore a saved state.

        Args:
            params: The plain values.
            arrays: The arrays; they are copied.
            names: Maps each allowed label or move to the part's own name for it.
            sizes: The lengths that are already known, by name.

        Raises:
            ValueError: If a field is missing, unknown or not as declared; the part may then be
                partly loaded.
        """
        values, others = dict(params), dict(arrays)
        self._take(values, others, names or {}, {} if sizes is None else sizes)
        for other in (*values, *others):
            raise ValueError(f"unknown field {str(other)[:60]!r}")

    def _take(self, params: Params, arrays: Arrays, names: Names, sizes: dict[str, int]) -> None:
        """Load the part's values and arrays, and remove them from `params` and `arrays`."""
        self.prepare(arrays)
        for own, part in self.parts():
            if not own:
                part._take(params, arrays, names, sizes)
                continue
            values = params.pop(own, {})
            demand(isinstance(values, Mapping), f"{own} is not a table")
            part.load(values, taken(arrays, _inner(own, "")), names, sizes)
        for field in self.fields:
            if isinstance(field, Value):
                field.load(self, params, names)
            else:
                field.load(self, arrays, sizes)
        self.restored()

    def array_names(self) -> set[str]:
        """Return the names of all arrays that the state may contain."""
        own = {field.name for field in self.fields if isinstance(field, Array)}
        inner = {_inner(own, key) for own, part in self.parts() for key in part.array_names()}
        return own | inner

    def check(self) -> None:
        """Raise ValueError with the reason if this part does not match its declaration."""
        for field in self.fields:
            field.check(self)
        for fault in self.faults():
            raise ValueError(fault)
        for _, part in self.parts():
            part.check()


def _inner(own: str, key: str) -> str:
    return f"{own}_{key}" if own else key


def taken(arrays: Arrays, start: str) -> Arrays:
    """Remove the arrays whose names begin with `start`; return them under names without `start`."""
    return {k.removeprefix(start): arrays.pop(k) for k in list(arrays) if k.startswith(start)}
