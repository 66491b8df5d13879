"""The program as it goes onto a brick: this very version, in one folder."""

from __future__ import annotations

import importlib.metadata
import shutil
from pathlib import Path

import robot


def make_bundle(folder: Path, server: Path, web: Path) -> None:
    """Copy the program into `folder`, made new and ready to be put on Python's path."""
    if folder.exists():
        shutil.rmtree(folder)
    leave_out = shutil.ignore_patterns("__pycache__", "*.pyc", "fonts", "web")
    shutil.copytree(Path(robot.__path__[0]), folder / "robot", ignore=leave_out)
    shutil.copytree(server, folder / "server", ignore=leave_out)
    shutil.copytree(web, folder / "server/web", ignore=shutil.ignore_patterns("__pycache__"))
    _copy_metadata(folder)


def _copy_metadata(folder: Path) -> None:
    """Take the entry points along: drivers and cameras are found by them."""
    about = importlib.metadata.distribution("drivelesson")
    target = folder / f"drivelesson-{about.version}.dist-info"
    target.mkdir(parents=True)
    for name in ("METADATA", "entry_points.txt"):
        (target / name).write_text(about.read_text(name) or "")
