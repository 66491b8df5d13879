"""Options that a driver or camera declares: a frozen dataclass whose fields become flags.

Each field has a default and `metadata={"help": ...}`. The metadata may also contain `choices`,
`range` as `(least, most)` for a number, and `secret` for a value that is never recorded. The
built-in devices declare fields with `option`, and `Options` refuses values out of range.
"""

from __future__ import annotations

import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from robot.devices.raw_value import number, plain_type, reader, whole
from robot.errors import ConfigurationError, did_you_mean

_NUMBERS: dict[type[Any], Callable[..., Any]] = {int: whole, float: number}


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One option, as shown on the command line or a settings page."""

    name: str
    type: type[Any]
    default: Any
    help: str
    choices: tuple[str, ...] | None = None
    range: tuple[float, float] | None = None
    is_secret: bool = False

    @property
    def flag(self) -> str:
        """The option as a flag: `frame_rate` is `--frame-rate`."""
        return "--" + self.name.replace("_", "-")

    def read(self, value: Any) -> Any:
        """Convert a value, or the text that a person typed, to this option's type."""
        least, most = self.range or (None, None)
        if self.choices is not None and str(value) not in self.choices:
            raise ConfigurationError(
                f"{self.flag} cannot be {value!r}{did_you_mean(str(value), self.choices)}; "
                f"choose one of: {', '.join(self.choices)}"
            )
        declare = _NUMBERS.get(self.type)
        declared = declare(least=least, most=most) if declare else ...
        try:
            return reader(self.type, declared)(value)
        except ConfigurationError as error:
            raise ConfigurationError(f"{self.flag} {error}") from error


def option(
    default: Any,
    help: str,
    *,
    choices: tuple[str, ...] | None = None,
    range: tuple[float, float] | None = None,
    secret: bool = False,
) -> Any:
    """Declare one option, as a field of a dataclass."""
    about = {"help": help, "choices": choices, "range": range, "secret": secret}
    return field(default=default, metadata=about)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Base class of option classes. The constructor refuses values out of range.

    Raises:
        ConfigurationError: If a number is out of its range, or `check` refuses a value.
    """

    def __post_init__(self) -> None:
        for declared in options_of(type(self)):
            value, allowed = getattr(self, declared.name), declared.range
            if allowed is not None and not allowed[0] <= value <= allowed[1]:
                declared.read(value)  # raise an error that names the valid values
        self.check()

    def check(self) -> None:
        """Raise an error for options that are invalid although all numbers are within range."""


def options_of(options_type: type[Any]) -> list[Option]:
    """List the options that a dataclass declares, in the order of its fields."""
    hints = typing.get_type_hints(options_type)
    return [
        Option(
            name=field.name,
            type=plain_type(hints[field.name]),
            default=None if field.default is MISSING else field.default,
            help=field.metadata.get("help", ""),
            choices=None if (of := field.metadata.get("choices")) is None else (*map(str, of),),
            range=field.metadata.get("range"),
            is_secret=field.metadata.get("secret", False),
        )
        for field in fields(options_type)
    ]


def make_options(options_type: type[Any], given: Mapping[str, Any]) -> Any:
    """Build the dataclass from values or texts. Options of other dataclasses are ignored.

    Raises:
        ConfigurationError: If a value has a wrong type, or is out of range.
    """
    return options_type(
        **{
            option.name: option.read(given[option.name])
            for option in options_of(options_type)
            if given.get(option.name) is not None
        }
    )
