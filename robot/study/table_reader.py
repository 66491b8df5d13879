"""Reads tables of a TOML file field by field; an error says what, where and what to do. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from robot.errors import ConfigurationError, did_you_mean
from robot.policy.registry import is_learner_kind, learner_kinds, split_name
from robot.types import Action

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,30}")
_LANGUAGE = re.compile(r"[a-z]{2}")
_LONGEST_WORDS = 4000
_MISSING: Any = object()


class TableReader:
    """One table, and where it stands.

    Args:
        table: What TOML made of it.
        where: The file, and the way to this table in it.
    """

    def __init__(self, table: Mapping[str, Any], where: str) -> None:
        self._table = table
        self._where = where
        self._known: list[str] = []

    def fault(self, what: str, remedy: str) -> ConfigurationError:
        """Return an error about this table."""
        return ConfigurationError(f"{self._where}: {what}; {remedy}")

    def refuse_unknown(self) -> None:
        """Raise if the table has a field that nobody asked for."""
        for name in self._table:
            if name not in self._known:
                hint = did_you_mean(name, self._known)
                raise self.fault(
                    f"there is no field {name!r}{hint}", f"known are {', '.join(self._known)}"
                )

    def _get(self, name: str, default: Any) -> Any:
        self._known.append(name)
        value = self._table.get(name, default)
        if value is _MISSING or value is None:
            raise self.fault(f"{name!r} is missing", "add it")
        return value

    def text(self, name: str, *, default: Any = _MISSING, most: int = 200) -> str:
        value = self._get(name, default)
        if not isinstance(value, str) or len(value) > most or not (value.isprintable()):
            raise self.fault(
                f"{name!r} is {_short(value)}", f"it must be one line of at most {most} characters"
            )
        return value

    def name(self, name: str, *, default: Any = _MISSING) -> str:
        """Return a short name, as it can stand in a column's title."""
        value = self._get(name, default)
        if not isinstance(value, str) or not _NAME.fullmatch(value):
            raise self.fault(
                f"{name!r} is {_short(value)}",
                "a name has up to 31 small letters, digits, - and _, and no spaces",
            )
        return value

    def whole(self, name: str, least: int, most: int, *, default: Any = _MISSING) -> int:
        value = self._get(name, default)
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            raise self.fault(
                f"{name!r} is {_short(value)}", f"it must be a whole number from {least} to {most}"
            )
        return value

    def number(self, name: str, *, above: float, most: float, default: Any = _MISSING) -> float:
        value = self._get(name, default)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not above < value <= most:
            raise self.fault(
                f"{name!r} is {_short(value)}",
                f"it must be a number above {above:g} and up to {most:g}",
            )
        return float(value)

    def one_of(self, name: str, choices: Sequence[str], *, default: Any = _MISSING) -> str:
        value = self._get(name, default)
        if value not in choices:
            hint = did_you_mean(str(value), choices)
            raise self.fault(
                f"{name!r} is {_short(value)}{hint}", f"choose {' or '.join(map(repr, choices))}"
            )
        return str(value)

    def names(self, name: str, choices: Sequence[str], *, default: Any) -> tuple[str, ...]:
        value = self._get(name, default)
        if not isinstance(value, list | tuple):
            raise self.fault(f"{name!r} is {_short(value)}", 'write a list: ["...", "..."]')
        for word in value:
            if word not in choices:
                hint = did_you_mean(str(word), choices)
                raise self.fault(
                    f"{name!r} has {_short(word)}{hint}", f"there are {', '.join(choices)}"
                )
        return tuple(dict.fromkeys(value))

    def moves(self, name: str, *, default: Any) -> tuple[Action, ...]:
        """Return a list of moves, at least one and each once."""
        value = self._get(name, default)
        remedy = 'write a list of moves such as ["forward", "left"]'
        if not isinstance(value, list | tuple) or not value:
            raise self.fault(f"{name!r} is {_short(value)}", remedy)
        try:
            moves = tuple(dict.fromkeys(Action(move) for move in value))
        except (TypeError, ValueError, AttributeError) as error:
            raise self.fault(f"{name!r} has what is no move: {error}", remedy) from error
        if Action.STOP in moves:
            raise self.fault(f"{name!r} has 'stop'", "leave it out: every robot stops")
        return moves

    def learner(self, name: str, *, default: Any) -> str:
        value = self.text(name, default=default)
        try:
            kind, _ = split_name(value)
        except ConfigurationError as error:
            raise self.fault(f"{name!r}: {error}", "default-32 is the usual one") from error
        if not is_learner_kind(kind):
            hint = did_you_mean(kind, learner_kinds())
            raise self.fault(f"{name!r} is {value!r}{hint}", "default-32 is the usual one")
        return value

    def words(self, name: str, *, needed: bool = False) -> dict[str, str]:
        """Return a text by language; {} if it is left out and not needed."""
        return self._words(name, self._get(name, _MISSING if needed else ""))

    def list_of_words(self, name: str, least: int, most: int) -> tuple[dict[str, str], ...]:
        """Return a list of texts by language."""
        value = self._get(name, _MISSING)
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise self.fault(f"{name!r} is {_short(value)}", f"list {least} to {most} texts")
        return tuple(self._words(name, item) for item in value)

    def _words(self, name: str, value: Any) -> dict[str, str]:
        table = {"en": value} if isinstance(value, str) else value
        is_good = isinstance(table, Mapping) and all(
            _LANGUAGE.fullmatch(code) and isinstance(text, str) and len(text) <= _LONGEST_WORDS
            for code, text in table.items()
        )
        if not is_good:
            raise self.fault(
                f"{name!r} is {_short(value)}",
                'write a text, or one a language: {en = "...", es = "...", zh = "..."}',
            )
        return {str(code): str(text).strip() for code, text in table.items() if str(text).strip()}

    def table(self, name: str) -> TableReader:
        """Return a table within this one; an empty one if it is left out."""
        value = self._get(name, {})
        if not isinstance(value, Mapping):
            raise self.fault(f"{name!r} is {_short(value)}", "write { teach = 90, ... }")
        return TableReader(value, f"{self._where}, {name}")

    def tables(self, name: str, least: int, most: int) -> list[TableReader]:
        """Return the tables [[name]], each knowing its number."""
        value = self._get(name, [])
        is_list = isinstance(value, list) and all(isinstance(part, Mapping) for part in value)
        if not is_list or not least <= len(value) <= most:
            found = len(value) if is_list else "something else"
            raise self.fault(
                f"there must be {least} to {most} tables [[{name}]], not {found}",
                f"begin each with a line [[{name}]]",
            )
        return [
            TableReader(part, f"{self._where}, [[{name}]] number {number}")
            for number, part in enumerate(value, start=1)
        ]


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
