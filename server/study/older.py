"""Results of guided trials that 0.2 kept as JSON in `lessons/`: to be listed and downloaded."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

from robot.errors import NotFoundError, RecordingError

_RESULT = re.compile(r"\d{8}-\d{6}-trial-[1-3]")
_FIELDS = ("began_at_s", "trial", "ssd", "answer")


def list_results(folder: Path) -> list[dict[str, Any]]:
    """Summarize each result, the newest first; those that cannot be read are left out."""
    lines = []
    for file in sorted(folder.glob("*.json"), reverse=True):
        try:
            result = json.loads(file.read_bytes())
            line = {name: result[name] for name in _FIELDS}
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            continue
        if _RESULT.fullmatch(file.stem) and all(map(_is_plain, line.values())):
            lines.append({"id": file.stem, **line})
    return lines


def _is_plain(value: object) -> bool:
    """True for what JSON can say: NaN is read from a file, and cannot be sent."""
    return value is None or (isinstance(value, int | float) and math.isfinite(value))


def read_result(folder: Path, result_id: str) -> bytes:
    """Return the file of one result.

    Raises:
        NotFoundError: If there is none.
        RecordingError: If it cannot be read.
    """
    path = folder / f"{result_id}.json"
    if not _RESULT.fullmatch(result_id) or not path.is_file():
        raise NotFoundError(f"unknown result {result_id[:80]!r}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise RecordingError(f"the result {result_id!r} cannot be read: {error}") from error
