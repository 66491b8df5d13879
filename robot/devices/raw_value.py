"""Validates values from outside the program. Each kind of value is declared once, with pydantic.

The code uses only features that pydantic 1.10 and 2 have in common, because bricks run Debian 12,
which has version 1.10. docs/adr/0037-typed-borders.md says why pydantic is used, and which modules
may import it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import UnionType
from typing import Any, NoReturn, Self, TypeVar, Union, get_args, get_origin

import pydantic
from pydantic import BaseModel, Field, ValidationError, create_model

from robot.errors import ConfigurationError

IS_OLD = pydantic.VERSION.startswith("1.")
_KINDS = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}
_STRICT: dict[str, Any] = {} if IS_OLD else {"strict": True}
_MOST_BITS = 1000
"""Maximum number of bits of an integer that a float can hold; Pydantic 1 fails at larger ones."""
_M = TypeVar("_M", bound=BaseModel)


class RawValue(BaseModel, **_STRICT):
    """Base class of objects from JSON or TOML. No value is converted, so "1" is not a number."""

    @classmethod
    def validate(cls, value: Any) -> Self:
        """Make pydantic 1 as strict as pydantic 2. Pydantic 2 never calls this method."""
        if not isinstance(value, cls | dict):
            raise TypeError("not an object")
        given: dict[str, Any] = value if isinstance(value, dict) else {}
        for name in fields_of(cls).keys() & given:
            if isinstance(given[name], int) and given[name].bit_length() > _MOST_BITS:
                _refuse(cls, name)
        read = super().validate(value)
        for name in fields_of(cls).keys() & given:
            if not _is_same(given[name], getattr(read, name)):
                _refuse(cls, name)
        return read


def number(
    default: Any = ...,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> Any:
    """Declare a number within limits: more than `above`, at least `least`, at most `most`."""
    wanted = _range("number", above, least, most)
    return Field(default, gt=above, ge=least, le=most, allow_inf_nan=False, description=wanted)


def whole(
    default: Any = ...,
    *,
    least: int | None = None,
    most: int | None = None,
    or_word: str | None = None,
) -> Any:
    """Declare an integer within limits; `or_word` is an alternative that the error mentions."""
    wanted = _range("whole number", None, least, most) + (f", or {or_word!r}" if or_word else "")
    return Field(default, ge=least, le=most, description=wanted)


def text(default: Any = ..., *, most: int = 200) -> Any:
    """Declare a text of at most `most` characters."""
    return Field(default, max_length=most, description=f"a text of at most {most} characters")


def must_be(wanted: str, default: Any = ...) -> Any:
    """Declare a value that is checked only by its type or by the code that reads it."""
    return Field(default, description=wanted)


def read(kind: type[_M], plain: Any, where: str = "") -> _M:
    """Validate an object from JSON or TOML."""
    try:
        return kind.validate(plain) if IS_OLD else kind.model_validate(plain)
    except (ValidationError, TypeError) as error:
        found = error.errors() if isinstance(error, ValidationError) else [{"loc": ()}]
        raise ConfigurationError(where + explain(kind, found[0]["loc"])) from error


def reader(kind: Any, declared: Any, base: type[BaseModel] = BaseModel) -> Callable[[Any], Any]:
    """Return a function that reads one value. The function converts text unless `base` is strict.

    The ConfigurationError is worded to follow the value's name: "must be a number, not 'x'".
    """
    model = create_model("Value", __base__=base, value=(kind, declared))
    return partial(_read_value, model, kind_of(kind))


def plain_type(hint: Any) -> type[Any]:
    """Return the type of an optional value: X for the annotation `X | None`."""
    if get_origin(hint) in (UnionType, Union):
        hint = next(part for part in get_args(hint) if part is not type(None))
    return hint if isinstance(hint, type) else str


def kind_of(hint: Any) -> str:
    """Return the name of a type in an error: "a whole number"."""
    return _KINDS.get(plain_type(hint), "a text")


def explain(kind: type[BaseModel] | None, loc: Sequence[str | int]) -> str:
    """Return the sentence for a refused value: its name, and the valid values."""
    if not loc or kind is None:
        return "The data must be a JSON object."
    return f"{loc[0]!r} must be {_description(kind, str(loc[0])) or 'left out'}."


def _read_value(model: type[BaseModel], wanted: str, value: Any) -> Any:
    try:
        read = model.validate({"value": value}) if IS_OLD else model(value=value)
    except (ValidationError, OverflowError) as error:
        wanted = _description(model, "value") or wanted
        raise ConfigurationError(f"must be {wanted}, not {value!r}") from error
    return read.value  # type: ignore[attr-defined]


def fields_of(kind: type[BaseModel]) -> Mapping[str, Any]:
    """Return each field as pydantic describes it, by name."""
    found: Mapping[str, Any] = getattr(kind, "__fields__" if IS_OLD else "model_fields")
    return found


def _description(kind: type[BaseModel], name: str) -> str | None:
    field = fields_of(kind).get(name)
    return field and (field.field_info if IS_OLD else field).description


def _is_same(given: Any, read: Any) -> bool:
    """True if nothing was converted, except integers to floats. False for lone surrogates."""
    if isinstance(given, list):
        return all(map(_is_same, given, read))
    if isinstance(given, str):
        return isinstance(read, str) and given == given.encode("utf-8", "ignore").decode()
    if isinstance(read, float):
        return isinstance(given, int | float) and not isinstance(given, bool)
    return isinstance(given, dict) or type(given) is type(read)


def _refuse(kind: type[BaseModel], name: str) -> NoReturn:
    from pydantic.error_wrappers import ErrorWrapper  # only pydantic 1 has this module

    raise ValidationError([ErrorWrapper(TypeError("converted"), name)], kind)


def _range(kind: str, above: float | None, least: float | None, most: float | None) -> str:
    if above is not None:
        kind += f" above {above:g}"
    elif least is not None:
        kind += f" from {least:.16g}" if most is not None else f" of at least {least:g}"
    if most is not None:
        kind += f" up to {most:.16g}" if above is not None or least is None else f" to {most:.16g}"
    return f"a {kind}"
