"""Options that a driver or camera declares: a frozen dataclass whose fields become flags.

Each field has a default and `metadata={"help": ...}`; `choices`, and for a number its `range` as
`(least, most)`, may be among the metadata; so may `secret`: the value is never recorded.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from robot.errors import ConfigurationError, did_you_mean

_KINDS = {int: "a whole number", float: "a number", bool: "true or false"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One option as a command line or a settings page shows it."""

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

    def parse(self, text: str) -> Any:
        """Convert text that a person typed to a value of this option's type.

        Raises:
            ConfigurationError: If it is not valid; says what was expected.
        """
        try:
            if self.type is bool:
                return {
                    "true": True,
                    "yes": True,
                    "1": True,
                    "false": False,
                    "no": False,
                    "0": False,
                }[text.lower()]
            value = self.type(text)
        except (ValueError, KeyError) as error:
            raise ConfigurationError(
                f"{self.flag} must be {_KINDS.get(self.type, 'text')}, not {text!r}"
            ) from error
        if self.choices is not None and value not in self.choices:
            raise ConfigurationError(
                f"{self.flag} cannot be {text!r}{did_you_mean(text, self.choices)}; "
                f"choose one of: {', '.join(self.choices)}"
            )
        return self.check(value)

    def check(self, value: Any) -> Any:
        """Return the value, unless it is a number out of range.

        Raises:
            ConfigurationError: If it is; says what the range is.
        """
        if self.range is not None and value is not None:
            least, most = self.range
            if not least <= value <= most:  # nor is what is no number
                raise ConfigurationError(
                    f"{self.flag} must be from {least:g} to {most:g}, not {value:g}"
                )
        return value


def options_of(options_type: type[Any]) -> list[Option]:
    """List the options that a dataclass declares, in its order."""
    hints = typing.get_type_hints(options_type)
    return [
        Option(
            name=field.name,
            type=_plain(hints[field.name]),
            default=None if field.default is MISSING else field.default,
            help=field.metadata.get("help", ""),
            choices=field.metadata.get("choices"),
            range=field.metadata.get("range"),
            is_secret=field.metadata.get("secret", False),
        )
        for field in fields(options_type)
    ]


def make_options(options_type: type[Any], given: Mapping[str, Any]) -> Any:
    """Build the dataclass from what was given; text is parsed, what is missing is the default.

    Names that this dataclass does not declare are left alone: they belong to other classes.

    Raises:
        ConfigurationError: If a value is not of its type, or out of range.
    """
    values: dict[str, Any] = {}
    for option in options_of(options_type):
        if option.name in given and given[option.name] is not None:
            value = given[option.name]
            is_text = isinstance(value, str)
            values[option.name] = option.parse(value) if is_text else option.check(value)
    return options_type(**values)


def _plain(hint: Any) -> type[Any]:
    """Reduce `X | None` to X: an option that may be left out is still of one type."""
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        hint = next(part for part in typing.get_args(hint) if part is not type(None))
    return hint if isinstance(hint, type) else str
