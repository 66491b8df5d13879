"""Runs programs to their end."""

from __future__ import annotations

import subprocess
from typing import Any


def run(*words: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; return its status and its output, as text."""
    given = {"capture_output": True, "text": True, "check": False, **options}
    return subprocess.run([str(word) for word in words], **given)
