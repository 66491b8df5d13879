"""Text files of other programs, as far as they are text."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robot.errors import RecordingError, told_as

_MOST_BYTES = 64 * 2**20


def read_text(path: Path) -> str:
    """Read a file; bytes that are no UTF-8 become question marks. RecordingError if it cannot be
    read, or is larger than 64 MB."""
    with told_as(RecordingError, f"{path} cannot be read"):
        if path.stat().st_size > _MOST_BYTES:
            raise RecordingError(f"{path} is too large")
        return path.read_text("utf-8-sig", errors="replace")


def parse(text: str) -> Any:
    """Return what a text says as JSON; None if it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
