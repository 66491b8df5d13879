"""The Debian 12 that runs the server on a brick: Debian's own packages for armel, and no more."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from robot.errors import ConfigurationError, RobotError

RELEASE = "bookworm"
PACKAGES = (
    "python3",
    "python3-numpy",
    "python3-fastapi",
    "python3-uvicorn",
    "python3-websockets",
    "python3-platformdirs",
    "python3-filelock",
    "python3-prometheus-client",
)
UNUSED = (
    "usr/share/doc",
    "usr/share/man",
    "usr/share/locale",
    "usr/share/info",
    "usr/share/lintian",
    "usr/lib/python3/dist-packages/numpy/*/tests",
    "usr/lib/python3/dist-packages/numpy/f2py",
    "usr/lib/python3.11/test",
    "usr/lib/python3.11/lib2to3",
    "usr/lib/python3.11/idlelib",
)
"""Left out, for the card's sake: nothing of it is ever imported."""
PYTHON_VERSION = (3, 11)
LIBRARIES = "usr/lib/arm-linux-gnueabi"


def build_userland(folder: Path) -> None:
    """Unpack the packages into `folder`; runs no program of them, so it works on any processor.

    Takes about ten seconds with a near mirror, and 80 MB.

    Raises:
        ConfigurationError: If mmdebstrap is not installed.
        RobotError: If a package cannot be had.
    """
    if shutil.which("mmdebstrap") is None:
        raise ConfigurationError(
            "mmdebstrap is not installed; on Debian and Ubuntu: apt install mmdebstrap "
            "debian-archive-keyring; elsewhere do this inside a Debian container"
        )
    done = subprocess.run(
        [
            "mmdebstrap",
            "--variant=extract",
            "--architectures=armel",
            f"--include={','.join(PACKAGES)}",
            RELEASE,
            str(folder),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        raise RobotError(f"mmdebstrap could not build the brick's Debian: {last[0]}")
    for pattern in UNUSED:
        for unused in folder.glob(pattern):
            shutil.rmtree(unused)
    _choose_alternatives(folder)


def _choose_alternatives(folder: Path) -> None:
    """Do what the packages' own scripts would: they were unpacked, not installed."""
    for name in ("blas", "lapack"):
        link = folder / LIBRARIES / f"lib{name}.so.3"
        link.unlink(missing_ok=True)
        link.symlink_to(f"{name}/lib{name}.so.3")


def precompile(root: Path, folders: tuple[str, ...]) -> bool:
    """Compile Python files of a userland ahead, without docstrings, as the brick runs them (-OO).

    Compiling at each start would cost a brick minutes, and the process 6 MB that it keeps.

    Returns:
        False if this machine's Python is another version than the brick's, which must then do it.
    """
    if sys.version_info[:2] != PYTHON_VERSION:
        return False
    command = [sys.executable, "-OO", "-m", "compileall", "-q", "-s", str(root), "-p", "/"]
    # A file that does not compile is one of another Python's tests; nobody imports it.
    subprocess.run(
        [*command, *(str(root / folder) for folder in folders)],
        stdout=subprocess.DEVNULL,
        check=False,
    )
    return True
