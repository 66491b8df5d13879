"""The minimal Debian that runs the server on a brick: only Debian's packages for armel."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from robot.errors import ConfigurationError, RobotError

PYTHON_VERSIONS = {"bookworm": (3, 11), "trixie": (3, 13)}
"""The Debian releases that are known to work, with their versions of Python. Trixie is the last
release for armel."""
DEFAULT_RELEASE = "bookworm"
"""Default release. Bookworm has pydantic 1, which takes 14 MB less than trixie's pydantic 2 and is
imported in half the time."""
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
    "usr/lib/python3.*/test",
    "usr/lib/python3.*/lib2to3",
    "usr/lib/python3.*/idlelib",
)
"""Folders left out to save space on the card; nothing in them is ever imported."""
LIBRARIES = "usr/lib/arm-linux-gnueabi"


def userland_stamp(release: str) -> str:
    return " ".join((release, *PACKAGES))


def build_userland(folder: Path, release: str = DEFAULT_RELEASE, mirror: str = "") -> None:
    """Unpack the packages into `folder`. None of their programs is run, so any processor can be
    used.

    Building takes about ten seconds with a nearby mirror. The unpacked system has 80 MB.

    Args:
        folder: The target folder.
        release: Name of the Debian release.
        mirror: Address of a mirror, for example http://deb.debian.org/debian; if empty, this
            machine's mirror is used, or else Debian's. Old releases move to
            http://archive.debian.org/debian.

    Raises:
        ConfigurationError: If mmdebstrap is not installed, or the release is unknown.
        RobotError: If a package is unavailable.
    """
    if release not in PYTHON_VERSIONS:
        raise ConfigurationError(
            f"--release {release} is not supported; choose one of: {', '.join(PYTHON_VERSIONS)}"
        )
    if shutil.which("mmdebstrap") is None:
        raise ConfigurationError(
            "mmdebstrap is not installed; on Debian and Ubuntu: apt install mmdebstrap "
            "debian-archive-keyring; on other systems, run this command in a Debian container"
        )
    done = subprocess.run(
        [
            "mmdebstrap",
            "--variant=extract",
            "--architectures=armel",
            f"--include={','.join(PACKAGES)}",
            release,
            str(folder),
            *([mirror] if mirror else []),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        raise RobotError(
            f"mmdebstrap could not build the brick's Debian: {last[0]}; "
            "try another mirror: --mirror http://deb.debian.org/debian"
        )
    for pattern in UNUSED:
        for unused in folder.glob(pattern):
            shutil.rmtree(unused)
    _choose_alternatives(folder)


def _choose_alternatives(folder: Path) -> None:
    """Make the links that the packages' scripts would make. The scripts did not run, because the
    packages were only unpacked."""
    for name in ("bin", "sbin", "lib"):  # since Debian trixie these folders are links into /usr
        if not (folder / name).exists():
            (folder / name).symlink_to(f"usr/{name}")
    for name in ("blas", "lapack"):
        link = folder / LIBRARIES / f"lib{name}.so.3"
        link.unlink(missing_ok=True)
        link.symlink_to(f"{name}/lib{name}.so.3")


def precompile(root: Path, folders: tuple[str, ...], release: str = DEFAULT_RELEASE) -> bool:
    """Compile the Python files in a brick's root file system in advance, without docstrings, as
    `python -OO` does on the brick.

    On a brick, compiling at each start would take minutes, and 6 MB of memory that the process
    would never free. `folders` are glob patterns below `root`. Returns False if this machine has no
    Python of the brick's version; then the brick must compile the files.
    """
    python = _python_of(PYTHON_VERSIONS[release])
    if python is None:
        return False
    command = [python, "-OO", "-m", "compileall", "-q", "-s", str(root), "-p", "/"]
    # Files that do not compile are tests for another Python version; no program imports them.
    subprocess.run(
        [*command, *(str(found) for folder in folders for found in root.glob(folder))],
        stdout=subprocess.DEVNULL,
        check=False,
    )
    return True


def _python_of(version: tuple[int, int]) -> str | None:
    """Return an interpreter of this version: the running one, or another on the PATH."""
    if sys.version_info[:2] == version:
        return sys.executable
    other = shutil.which(f"python{version[0]}.{version[1]}")
    # The program may be a stub of a version manager and run nothing.
    if other is None or subprocess.run([other, "-V"], capture_output=True).returncode != 0:
        return None
    return other
