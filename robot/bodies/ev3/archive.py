"""Packs the files for a brick: the agent as one file, or the whole program as a tar archive.

The agent's file is a zip, `agent.pyz`, which a brick's Python 3.5 runs directly.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import io
import shutil
import tarfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import robot
from robot.errors import MissingExtraError

SOURCES = (
    "bodies/ev3/agent/*.py",
    "bodies/v4l2/*.py",
    "devkit/freshness.py",
    "devkit/usb_camera.py",
)
LEFT_OUT = ("bodies/v4l2/camera.py",)
"""Files that the agent's archive omits. Only the server uses these files, and they need a newer
Python than the brick has."""
EPOCH = (1980, 1, 1, 0, 0, 0)
MAIN = "from robot.bodies.ev3.agent.__main__ import main\n\nmain()\n"
Files = Sequence[tuple[str, Path | bytes]]
"""Names inside a tar archive, each with its source: a local file or folder, or bytes."""


def agent_sources() -> dict[str, Path]:
    """Return the agent's modules: their names in the archive, each with its local file."""
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
    return f"{importlib.metadata.version('drivelesson')} {digest.hexdigest()[:8]}"


def make_agent() -> bytes:
    """Return the agent's archive; the same sources give the same bytes."""
    contents = {name: file.read_text() for name, file in agent_sources().items()}
    # The parent packages' `__init__.py` may need a newer Python, so empty files replace them.
    parents = {parent for name in contents for parent in list(Path(name).parents)[:-1]}
    empty = {f"{parent.as_posix()}/__init__.py": "" for parent in parents}
    contents = {"__main__.py": MAIN} | empty | {n: t for n, t in contents.items() if n not in empty}
    contents["robot/bodies/ev3/agent/release.py"] = f"RELEASE = {release()!r}\n"
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in sorted(contents.items()):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def make_bundle(folder: Path, server: Path, web: Path) -> None:
    """Copy this installation and python-ev3dev2 into `folder`, which will be on Python's path.

    Args:
        folder: The target folder; it is created.
        server: Folder of the package `server`.
        web: Folder of the page's files.

    Raises:
        MissingExtraError: If python-ev3dev2 is not installed on this machine.
    """
    ev3dev2 = importlib.util.find_spec("ev3dev2")
    if ev3dev2 is None or ev3dev2.origin is None:
        raise MissingExtraError("putting the program on a brick", "ev3")
    if folder.exists():
        shutil.rmtree(folder)
    leave_out = shutil.ignore_patterns("__pycache__", "*.pyc", "fonts", "web")
    shutil.copytree(Path(robot.__path__[0]), folder / "robot", ignore=leave_out)
    shutil.copytree(server, folder / "server", ignore=leave_out)
    shutil.copytree(web, folder / "server/web", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(Path(ev3dev2.origin).parent, folder / "ev3dev2", ignore=leave_out)
    _copy_metadata(folder)


def _copy_metadata(folder: Path) -> None:
    """Copy the package's metadata, whose entry points list the drivers and cameras."""
    about = importlib.metadata.distribution("drivelesson")
    target = folder / f"drivelesson-{about.version}.dist-info"
    target.mkdir(parents=True)
    for name in ("METADATA", "entry_points.txt"):
        (target / name).write_text(about.read_text(name) or "")


def write_tar(stream: IO[bytes], files: Files) -> None:
    """Write files as a tar archive in which root owns all of them."""
    with tarfile.open(fileobj=stream, mode="w|") as tar:
        for name, content in files:
            if isinstance(content, Path):
                tar.add(content, name, filter=_as_root)
            else:
                entry = tarfile.TarInfo(name)
                entry.size, entry.mode = len(content), 0o600
                tar.addfile(entry, io.BytesIO(content))


def _as_root(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = "root"
    return entry
