"""Identifies everything that affects a run's results: the program, Python, its libraries, and the
arithmetic.

The workers of a cluster get this file as text and run it, even if this program is not installed
there. The file therefore needs only the standard library of any Python 3.
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
"""Libraries that affect results. Packages that extend this program affect results, too; `identify`
finds them by their entry points."""


def identify() -> dict[str, str]:
    """Return the versions of all code that affects this process's results; `MISSING` for absent
    code."""
    return {
        "drivelesson": fingerprint(_program()),
        "Python": platform.python_version(),
        **{name: _version(name) for name in sorted({*LIBRARIES, *_plugins()})},
    }


def identify_all() -> dict[str, str]:
    """Return the result of `identify`, and under `arithmetic` a fingerprint of computed numbers."""
    return {**identify(), "arithmetic": arithmetic()}


def differences(ours: Mapping[str, str], theirs: Mapping[str, str]) -> list[str]:
    """Describe how the versions in another process (`theirs`) differ from the versions in this
    process (`ours`). The most important difference comes first."""
    if theirs["drivelesson"] == MISSING:
        return ["it does not have Drivelesson"]
    names = dict.fromkeys((*ours, *theirs))
    found = [
        f"{name} {theirs.get(name, MISSING)} there, {ours.get(name, MISSING)} here"
        for name in names
        if name != "arithmetic" and ours.get(name, MISSING) != theirs.get(name, MISSING)
    ]
    if not found and ours["arithmetic"] != theirs["arithmetic"]:
        found = ["sums differ in the last digits (another processor, or OMP_NUM_THREADS is not 1)"]
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
    """Return a fingerprint of numpy's results on this machine, to the last digit.

    The results depend on the processor, on the linear algebra library, and on the number of
    threads, because each thread adds up a part of a sum.
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
    """Return the folder of this program's package `robot`. Return None if it is missing, or if
    `robot` is Robot Framework."""
    try:
        found = importlib.util.find_spec("robot")
    except (ImportError, ValueError):
        return None
    places = list(found.submodule_search_locations or ()) if found is not None else []
    folders = [Path(place) for place in places if (Path(place) / "lab" / "task.py").is_file()]
    return folders[0] if folders else None


def _plugins() -> set[str]:
    """Return the names of the installed packages that extend this program."""
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
