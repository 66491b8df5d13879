"""Parses each table of a plan. An error says what is wrong, where, and what to do. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Self

from robot.devices.raw_value import RawValue, fields_of, must_be, read
from robot.errors import ConfigurationError, did_you_mean, told_as
from robot.policy.registry import is_learner_kind, learner_kinds, split_name
from robot.types import Action

Words = dict[str, str]
"""A text by language (`en`, `es`, `zh`)."""
_BY_LANGUAGE = ("consent", "instructions", "text", "low", "high")
_TEXT = 'a text, or one per language: {en = "...", es = "...", zh = "..."}'
_NAME, _LANGUAGE = re.compile(r"[a-z0-9][a-z0-9_-]{0,30}"), re.compile(r"[a-z]{2}")
_LONGEST_WORDS = 4000


def words(default: Any = ...) -> Any:
    """Declare a field whose value is a text, or one text per language."""
    return must_be(_TEXT, default)


class PlanTable(RawValue):
    """Base class of the tables in a study's TOML files. Fields of the same name are checked in the
    same way in all tables."""

    @classmethod
    def read(cls, table: Mapping[str, Any], where: str) -> Self:
        """Parse one table. The message of a ConfigurationError begins with `where`."""
        refuse_unknown(table, cls.known(table), where)
        spread = {name: _by_language(name, value) for name, value in table.items()}
        found = read(cls, spread, f"{where}: ")
        with told_as(ConfigurationError, where, ValueError):
            for name in table:
                _check(name, getattr(found, name))
            found.check_together()
        return found

    @classmethod
    def read_all(
        cls, tables: Sequence[Mapping[str, Any]], where: str, name: str, least: int, most: int
    ) -> list[Self]:
        """Parse the tables [[name]]; errors contain the table's number."""
        if not least <= len(tables) <= most:
            raise ConfigurationError(
                f"{where}: there must be {least} to {most} tables [[{name}]], not {len(tables)}; "
                f"begin each with a line [[{name}]]"
            )
        return [
            cls.read(table, f"{where}, [[{name}]] number {number}")
            for number, table in enumerate(tables, start=1)
        ]

    @classmethod
    def known(cls, table: Mapping[str, Any]) -> Sequence[str]:
        """Return the fields that a table of this kind may have."""
        return list(fields_of(cls))

    def check_together(self) -> None:
        """Raise ValueError if fields of the table contradict each other. The base class checks
        nothing; a subclass may override this method."""


def refuse_unknown(table: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    for name in table:
        if name not in known:
            hint = f"{did_you_mean(name, known)}; known: {', '.join(known)}"
            raise ConfigurationError(f"{where}: unknown field {name!r}{hint}")


def refuse_twins(names: Sequence[str], what: str, where: str) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(
                f"{where}: the name {name!r} is used for two {what}s; give each its own name"
            )


def _by_language(name: str, value: Any) -> Any:
    """Return a text as a dictionary by language. A plain string counts as English."""
    if name == "options" and isinstance(value, list):
        return [_by_language("text", each) for each in value]
    if name not in _BY_LANGUAGE or not isinstance(value, str):
        return value
    return {"en": value.strip()} if value.strip() else {}


def _check(name: str, value: Any) -> None:
    """Refuse values that a plan must not have, although the type of the field allows them."""
    if name == "name" and not _NAME.fullmatch(value):
        raise ValueError(
            f"'name' is {value[:40]!r}; "
            "use up to 31 lower-case letters, digits, - and _, and no spaces"
        )
    if name in ("title", "world") and not value.isprintable():
        raise ValueError(f"{name!r} is {value[:40]!r}; write it on one line")
    texts = value if name == "options" else [value] if name in _BY_LANGUAGE else []
    for code, said in (pair for each in texts for pair in each.items()):
        if not _LANGUAGE.fullmatch(code) or len(said) > _LONGEST_WORDS:
            raise ValueError(f"{name!r} has {code[:40]!r}, which is not a language; write {_TEXT}")
    if name == "moves" and (not value or Action.STOP in map(Action, value)):
        raise ValueError("'moves' must name at least one move, and never 'stop'")
    if name == "learner" and not is_learner_kind(kind := split_name(value)[0]):
        hint = did_you_mean(kind, learner_kinds())
        raise ValueError(
            f"'learner' is {value!r}, which is unknown{hint}; the default is default-32"
        )
