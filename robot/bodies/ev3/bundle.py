"""The program as it goes onto a brick: this very version, with python-ev3dev2, in one folder."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import shutil
from pathlib import Path

import robot
from robot.errors import MissingExtraError


def make_bundle(folder: Path, server: Path, web: Path) -> None:
    """Copy the program into `folder`, ready to be put on Python's path.

    Args:
        folder: Where to; made new.
        server: Folder of the package `server`.
        web: Folder of the page's files.

    Raises:
        MissingExtraError: If python-ev3dev2 is not installed here to be copied.
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
    """Take the entry points along: drivers and cameras are found by them."""
    about = importlib.metadata.distribution("drivelesson")
    target = folder / f"drivelesson-{about.version}.dist-info"
    target.mkdir(parents=True)
    for name in ("METADATA", "entry_points.txt"):
        (target / name).write_text(about.read_text(name) or "")
