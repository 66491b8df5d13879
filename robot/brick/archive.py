"""The agent as one file: a zip that the Python 3.5 of a brick runs as it is (`agent.pyz`)."""

from __future__ import annotations

import hashlib
import io
import zipfile
from importlib.metadata import version
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


def release() -> str:
    """Return the release name of this agent: the version, and a digest of its sources."""
    digest = hashlib.sha256()
    for name, file in sorted(agent_sources().items()):
        digest.update(name.encode() + b"\0" + file.read_bytes())
    return f"{version('drivelesson')} {digest.hexdigest()[:8]}"


def make_agent() -> bytes:
    """Return the archive; the same sources give the same bytes."""
    contents = {name: file.read_text() for name, file in agent_sources().items()}
    # The parents' own __init__.py may be written for a newer Python: here they are empty.
    contents |= {"__main__.py": MAIN, "robot/__init__.py": "", "robot/brick/__init__.py": ""}
    contents["robot/brick/agent/release.py"] = f"RELEASE = {release()!r}\n"
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in sorted(contents.items()):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
