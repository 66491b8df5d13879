"""The agent as one file: a zip that the Python 3.5 of a brick runs as it is (`agent.pyz`)."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import robot

PACKAGES = ("brick/agent", "capture")
LEFT_OUT = ("capture/options.py",)
"""Needs a newer Python, and serves the command line alone."""
EPOCH = (1980, 1, 1, 0, 0, 0)
MAIN = "from robot.brick.agent.__main__ import main\n\nmain()\n"


def agent_sources() -> dict[str, Path]:
    """Return the modules that go along: name inside the archive to file here."""
    top = Path(next(iter(robot.__path__)))
    return {
        f"robot/{name}": top / name
        for package in PACKAGES
        for file in sorted((top / package).glob("*.py"))
        if (name := file.relative_to(top).as_posix()) not in LEFT_OUT
    }


def make_agent() -> bytes:
    """Return the archive; the same sources give the same bytes."""
    # The parents' own __init__.py may be written for a newer Python: here they are empty.
    contents = {"__main__.py": MAIN, "robot/__init__.py": "", "robot/brick/__init__.py": ""}
    contents |= {name: file.read_text() for name, file in agent_sources().items()}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in sorted(contents.items()):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
