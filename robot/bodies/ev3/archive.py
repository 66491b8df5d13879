"""The agent as one file: a zip that the Python 3.5 of a brick runs as it is (`agent.pyz`)."""

from __future__ import annotations

import hashlib
import io
import zipfile
from importlib.metadata import version
from pathlib import Path

import robot

SOURCES = ("bodies/ev3/agent/*.py", "bodies/v4l2/*.py", "devices/freshness.py")
LEFT_OUT = ("bodies/v4l2/camera.py",)
"""It needs a newer Python, and serves the program on a computer alone."""
EPOCH = (1980, 1, 1, 0, 0, 0)
MAIN = "from robot.bodies.ev3.agent.__main__ import main\n\nmain()\n"


def agent_sources() -> dict[str, Path]:
    """Return the modules that go along: name inside the archive to file here."""
    top = Path(next(iter(robot.__path__)))
    return {
        f"robot/{name}": top / name
        for pattern in SOURCES
        for file in sorted(top.glob(pattern))
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
    parents = {parent for name in contents for parent in list(Path(name).parents)[:-1]}
    empty = {f"{parent.as_posix()}/__init__.py": "" for parent in parents}
    contents = {"__main__.py": MAIN} | empty | {n: t for n, t in contents.items() if n not in empty}
    contents["robot/bodies/ev3/agent/release.py"] = f"RELEASE = {release()!r}\n"
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in sorted(contents.items()):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
