"""Files that commands write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robot.errors import ConfigurationError, told_as


def check_writable(path: Path | None) -> None:
    """Raise ConfigurationError if the file cannot be written. Commands check this first, because
    their work may take hours."""
    if path is not None:
        with told_as(ConfigurationError, f"cannot write {path}"):
            path.open("a").close()


def write_text(path: Path, text: str) -> None:
    with told_as(ConfigurationError, f"cannot write {path}"):
        path.write_text(text, encoding="utf-8")


def write_json(path: Path | None, plain: Any) -> None:
    """Write the results to the file of the option --json, if it was given."""
    if path is not None:
        write_text(path, json.dumps(plain, indent=1) + "\n")
