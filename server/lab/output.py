"""Lists of numbers, and files that commands write."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from robot.errors import ConfigurationError

_T = TypeVar("_T", int, float)


def numbers_in(text: str, kind: Callable[[str], _T], option: str) -> list[_T]:
    """Return the numbers of an option, with commas between."""
    try:
        return [kind(part) for part in text.split(",")]
    except ValueError as error:
        raise ConfigurationError(f"{option} expects numbers such as 1,10, not {text!r}") from error


def write_text(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"cannot write {path}: {error}") from error


def write_json(path: Path | None, plain: Any) -> None:
    """Write what the option --json asked for, if it was given."""
    if path is not None:
        write_text(path, json.dumps(plain, indent=1) + "\n")
