"""Identifies the causes of a run's figures: the program, Python, its libraries, and the arithmetic.

A cluster's workers are sent this file as text and run it, whether they have this program or not:
it needs only the standard library, and any Python 3.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import platform
from collections.abc import Mapping
from pathlib import Path

MISSING = "missing"
LIBRARIES = ("numpy", "panda3d", "opencv-python-headless", "scikit-learn", "river")
"""Libraries that decide figures. Packages with entry points of this program are added."""


def identify() -> dict[str, str]:
    """Return the code that decides the figures of this process; `MISSING` where it is absent."""
    return {
        "drivelesson": fingerprint(_program()),
        "Python": platform.python_version(),
        **{name: _version(name) for name in sorted({*LIBRARIES, *_plugins()})},
    }


def identify_all() -> dict[str, str]:
    """Return the code, and under `arithmetic` what it computes on this processor."""
    return {**identify(), "arithmetic": arithmetic()}


def differences(ours: Mapping[str, str], theirs: Mapping[str, str]) -> list[str]:
    """Say in words what another process has otherwise, most important first."""
    if theirs["drivelesson"] == MISSING:
        return ["it does not have Drivelesson"]
    names = dict.fromkeys((*ours, *theirs))
    found = [
        f"{name} {theirs.get(name, MISSING)} there, {ours.get(name, MISSING)} here"
        for name in names
        if name != "arithmetic" and ours.get(name, MISSING) != theirs.get(name, MISSING)
    ]
    if not found and ours["arithmetic"] != theirs["arithmetic"]:
        found = ["its sums differ in the last digits (another processor, or OMP_NUM_THREADS not 1)"]
    return found


def fingerprint(folder: Path | None) -> str:
    """Return a fingerprint of all modules and worlds in a folder."""
    if folder is None:
        return MISSING
    digest = hashlib.sha256()
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def arithmetic() -> str:
    """Return a fingerprint of what numpy computes here, to the last digit.

    It depends on the processor, on the library of linear algebra, and on how many threads share a
    sum.
    """
    try:
        import numpy as np
    except ImportError:
        return MISSING
    digest = hashlib.sha256()
    numbers = np.random.default_rng(5)
    for rows, columns in ((8, 8), (40, 700), (300, 300)):
        a = numbers.normal(size=(rows, columns))
        square = a @ a.T
        parts = (
            square,
            a @ a[0],
            a[:, 0] @ a,
            np.linalg.solve(square + rows * np.eye(rows), a[:, 0]),
            np.exp(a),
            np.hypot(a, 1.0),
            np.arctan2(a, a[::-1]),
            np.sin(a),
            a.sum(axis=0),
            np.float64(a.std()),
            a.astype(np.float32) @ a.T.astype(np.float32),
        )
        for part in parts:
            digest.update(np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()[:16]


def _program() -> Path | None:
    """Return the folder of `robot`, if it is this program's (Robot Framework has one, too)."""
    try:
        found = importlib.util.find_spec("robot")
    except (ImportError, ValueError):
        return None
    places = list(found.submodule_search_locations or ()) if found is not None else []
    folders = [Path(place) for place in places if (Path(place) / "lab" / "task.py").is_file()]
    return folders[0] if folders else None


def _plugins() -> set[str]:
    """Name the other installed packages that add something to this program."""
    return {
        str(package.metadata["Name"])
        for package in importlib.metadata.distributions()
        if any(point.group.startswith("drivelesson.") for point in package.entry_points)
    } - {"drivelesson"}


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return MISSING
