"""Reads settings from a file and from environment variables, as defaults of the command line.

The command line overrides the environment, and the environment overrides the file.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from robot.devices.raw_value import RawValue, number, reader, whole
from robot.errors import ConfigurationError, did_you_mean, told_as

PREFIX = "DRIVELESSON_"
TABLES = ("limits", "gate", "governor", "patience")
"""The tables of the file, which hold the settings that no command-line option can set."""
_T = TypeVar("_T")
_TRUE, _FALSE = ("1", "true", "yes", "on"), ("0", "false", "no", "off", "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings from the file and the environment: options (`flags`), and the file's tables."""

    file: Path | None = None
    flags: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    environ: Mapping[str, str] = field(default_factory=dict)

    def get(self, name: str, default: Any = None) -> Any:
        """Return an option's value from the environment, or else from the file, or `default`."""
        return self.environ.get(PREFIX + name.upper(), self.flags.get(name, default))

    def place(self, name: str) -> str:
        """Return where an option's value was set, for an error message."""
        variable = PREFIX + name.upper()
        return variable if variable in self.environ else f"{self.file}: {name}"


def read_settings(file: Path | None, environ: Mapping[str, str]) -> Settings:
    content = _read_file(file) if file else {}
    tables = {name: content.pop(name) for name in TABLES if name in content}
    if not all(isinstance(table, dict) for table in tables.values()):
        raise ConfigurationError(f"{file}: {', '.join(tables)} must be tables")
    return Settings(file=file, flags=content, tables=tables, environ=environ)


def parse_settings(text: str) -> dict[str, Any]:
    """Parse TOML, in which names may be spelled with hyphens; raises TOMLDecodeError."""
    return {name.replace("-", "_"): value for name, value in tomllib.loads(text).items()}


def apply_to(parser: argparse.ArgumentParser, settings: Settings) -> None:
    actions = {action.dest: action for action in parser._actions}  # argparse has no public list
    if unknown := [name for name in settings.flags if name not in actions]:
        hint = did_you_mean(unknown[0], actions)
        raise ConfigurationError(f"{settings.file}: unknown setting {', '.join(unknown)}{hint}")
    for name, action in actions.items():
        value = settings.get(name)
        # Skip an empty value, because an empty path would mean the working directory.
        if value is not None and (value != "" or action.type is not Path):
            parser.set_defaults(**{name: _typed(action, value, settings.place(name))})


def _typed(action: argparse.Action, value: Any, at: str) -> Any:
    """Convert a value as argparse would; an error names the setting instead of the option."""
    if isinstance(action, argparse._StoreTrueAction):
        if (text := str(value).lower()) not in _TRUE + _FALSE:
            raise ConfigurationError(f"{at} must be true or false, not {value!r}")
        return text in _TRUE
    if not isinstance(value, str | int | float):
        raise ConfigurationError(f"{at} must be text or a number, not {value!r}")
    read: Any = action.type or str
    with told_as(ConfigurationError, at, argparse.ArgumentTypeError, ValueError):
        return read(str(value))


def build(kind: type[_T], table: Mapping[str, Any], name: str) -> _T:
    """Build a dataclass of numbers, such as `Limits`, from a table of the file."""
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    for key, value in table.items():
        if key not in known:
            hint = did_you_mean(key, known)
            raise ConfigurationError(
                f"unknown setting {key} in [{name}]{hint}; known: {', '.join(known)}"
            )
        is_whole = known[key].type == "int"
        declared = whole(least=0) if is_whole else number(least=0)
        with told_as(ConfigurationError, f"[{name}] {key}", ConfigurationError):
            reader(int if is_whole else float, declared, RawValue)(value)
    return kind(**table)


def _read_file(file: Path) -> dict[str, Any]:
    with told_as(ConfigurationError, f"cannot read {file}"):
        data = file.read_bytes()
    with told_as(ConfigurationError, f"{file} is not valid TOML", ValueError, RecursionError):
        return parse_settings(data.decode("utf-8-sig"))
