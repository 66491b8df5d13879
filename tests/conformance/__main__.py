"""Tests the newest version of each program that shares files or formats with this one: `make
conformance`.

Each program gets a separate environment below var/conformance, in which a script of this folder
uses the program. The final table names the programs that cannot be installed; they are no failure.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from .driving import tries
from .samples import Samples, imports_of, make_samples

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PATIENCE_S = 3600


class Result(NamedTuple):
    """One line of the table; the outcome is `passed`, `FAILED: why` or `unavailable: why`."""

    peer: str
    version: str
    check: str
    outcome: str


class UnavailableError(Exception):
    """Neither this machine nor an index or package manager has the program."""


def check_lerobot(home: Path, samples: Samples) -> Iterator[Result]:
    """Load, edit and merge an export; import its datasets."""
    python = _environment(home, ["lerobot[dataset,training]"], "lerobot")
    out = _fresh(home / "out")
    given = samples.lerobot, samples.other, samples.plain
    yield from _run(home.name, [python, HERE / "in_lerobot.py", *given, out])
    for name in ("own", "both", "driven"):
        yield _import(home.name, out / name)


def check_donkeycar(home: Path, samples: Samples) -> Iterator[Result]:
    """Read, delete from and append to an export; import the result."""
    python = _environment(home, ["donkeycar"], "donkeycar.parts.tub_v2")
    out = _fresh(home / "out")
    yield from _run(home.name, [python, HERE / "in_donkeycar.py", samples.tub, out])
    yield _import(home.name, out)


def check_mcap_in_python(home: Path, samples: Samples) -> Iterator[Result]:
    """Read a recording, check all checksums, and decode Foxglove's messages."""
    packages = ["mcap", "mcap-protobuf-support", "lz4", "zstandard"]
    python = _environment(home, packages, "mcap_protobuf")
    yield from _run(home.name, [python, HERE / "in_mcap.py", samples.recording])


def check_mcap_in_javascript(home: Path, samples: Samples) -> Iterator[Result]:
    """Read a recording with MCAP's JavaScript library."""
    npm = _program("npm", "node")
    home.mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / "in_mcap.mjs", home)
    packages = ["@mcap/core@latest", "@mcap/nodejs@latest", "@mcap/support@latest"]
    _get([npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", home, *packages])
    yield from _run(home.name, [_program("node"), home / "in_mcap.mjs", samples.recording])


def check_ffprobe(home: Path, samples: Samples) -> Iterator[Result]:
    """Probe an exported film and a dataset's film, and decode every frame."""
    probe = shutil.which("ffprobe")
    if probe is None:  # Debian's package needs many libraries; this one needs none
        npm, package = _program("npm"), "@ffprobe-installer/linux-x64"
        _get([npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", home, package])
        probe = str(home / "node_modules" / package / "ffprobe")
    version = _said([probe, "-version"]).split()[2]
    for film in (samples.film, next(samples.lerobot.rglob("*.mp4"))):
        fields = "stream=codec_name,pix_fmt,nb_read_frames"
        words = [probe, "-v", "error", "-count_frames", "-show_entries", fields, "-of", "json"]
        done = _tried([*words, film])
        [stream] = json.loads(done.stdout or "{}").get("streams") or [{}]
        frames = stream.get("nb_read_frames")
        is_good = not done.stderr and stream.get("codec_name") == "h264" and int(frames or 0) > 9
        outcome = "passed" if is_good else f"FAILED: {done.stderr or stream}"
        yield Result(home.name, version, f"{film.name}: {frames} frames", outcome)


def check_promtool(home: Path, samples: Samples) -> Iterator[Result]:
    """Check the output of `/metrics`, and the alerts of the docs."""
    promtool = _program("promtool", package="prometheus", home=home)
    version = _said([promtool, "--version"]).split()[2]
    alerts = ROOT / "docs/examples/monitoring/alerts.yml"
    for check, words, text in (
        ("metrics", ["check", "metrics"], samples.metrics),
        ("alerts", ["check", "rules", str(alerts)], ""),
    ):
        done = _tried([promtool, *words], input=text)
        outcome = f"FAILED: {done.stderr or done.stdout}" if done.returncode else "passed"
        yield Result(home.name, version, check, outcome)


def check_lerobot_robot(home: Path, samples: Samples) -> Iterator[Result]:
    """Record and drive served robots by LeRobot's commands, with the package of the docs."""
    lerobot = home.parent / "lerobot"
    lerobot.mkdir(exist_ok=True)
    python = _environment(lerobot, ["lerobot[dataset,training]"], "lerobot")
    _get([python, "-m", "pip", "install", "--quiet", "--upgrade", ROOT])
    plugin = ROOT / "docs" / "examples" / "lerobot"
    _get([python, "-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", plugin])
    version = _said([python, "-c", "import lerobot; print(lerobot.__version__)"]).strip()
    for check, attempt in tries(python, _fresh(home / "out"), samples):
        told, outcome = _attempted(attempt)
        yield Result(home.name, version, f"{check}: {told}" if told else check, outcome)


def check_fastdds(home: Path, samples: Samples) -> Iterator[Result]:
    """Drive a ROS 2 robot in another process over DDS, receive its pictures, and disturb it."""
    from . import on_dds

    program = home / "fastdds"
    source = HERE / "fastdds.cpp"
    _get([_program("g++"), "-O1", "-o", program, source, "-lfastrtps", "-lfastcdr"])
    said = _said(["dpkg-query", "-W", "-f", "${Version}", "libfastrtps-dev"])
    for attempt in on_dds.attempts(program):
        yield Result(home.name, said, *_attempted(attempt))


CHECKS: dict[str, Callable[[Path, Samples], Iterator[Result]]] = {
    "mcap": check_mcap_in_python,
    "mcap.js": check_mcap_in_javascript,
    "promtool": check_promtool,
    "ffprobe": check_ffprobe,
    "donkeycar": check_donkeycar,
    "lerobot": check_lerobot,
    "lerobot_robot": check_lerobot_robot,
    "fastdds": check_fastdds,
}


def main() -> int:
    """Run the checks; returns 1 if one has failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.conformance", description=__doc__)
    parser.add_argument("--folder", type=Path, default=ROOT / "var" / "conformance")
    parser.add_argument("--only", nargs="+", choices=CHECKS, default=list(CHECKS))
    args = parser.parse_args()
    folder = args.folder.resolve()
    samples = make_samples(_fresh(folder / "samples"))
    results = [r for name in args.only for r in _results(name, folder / name, samples)]
    widths = [max(map(len, column)) for column in zip(*results, strict=True)][:3]
    print()
    for *cells, outcome in results:
        print("  ".join(c.ljust(w) for c, w in zip(cells, widths, strict=True)), outcome)
    return any(result.outcome.startswith("FAILED") for result in results)


def _results(name: str, home: Path, samples: Samples) -> Iterator[Result]:
    print(f"{name} ...", file=sys.stderr, flush=True)
    home.mkdir(parents=True, exist_ok=True)
    try:
        yield from CHECKS[name](home, samples)
    except UnavailableError as error:
        yield Result(name, "", "", f"unavailable: {str(error).strip()[-200:]}")


def pythons() -> list[Path]:
    """Return the Pythons of this machine that the package supports, the newest first."""
    found = {}
    names = [f"python3.{minor}" for minor in range(11, 20)]
    there = [shutil.which(name) for name in names]
    there += [str(p) for name in names for p in Path.home().glob(f".pyenv/versions/*/bin/{name}")]
    for path in filter(None, there):
        done = _tried([path, "-c", "import sys, venv, ssl; print(*sys.version_info[:3])"])
        if done.returncode == 0:
            found[tuple(map(int, done.stdout.split()))] = Path(path)
    newest = {version[:2]: version for version in sorted(found)}
    return [found[version] for _, version in sorted(newest.items(), reverse=True)]


def _environment(home: Path, packages: list[str], module: str) -> Path:
    """Install the newest versions of some packages, with the newest Python that has them."""
    why, newest = "no Python", dict[Path, tuple[int, ...]]()
    for python in pythons():
        try:
            newest[python] = _newest(home, python, packages[0].partition("[")[0])
        except UnavailableError as error:
            why = str(error)
    for python in sorted(newest, key=lambda python: newest[python], reverse=True):
        own = _virtual(home, python)
        try:
            _get([own, "-m", "pip", "install", "--quiet", "--upgrade", *packages])
            _get([own, "-c", f"import {module}"])
        except UnavailableError as error:
            why = str(error)
        else:
            return own
    raise UnavailableError(why)


def _newest(home: Path, python: Path, package: str) -> tuple[int, ...]:
    """Return the newest version of a package that supports a Python."""
    report = home / "report.json"
    words = [_virtual(home, python), "-m", "pip", "install", "--quiet", "--dry-run", "--no-deps"]
    _get([*words, "--ignore-installed", "--report", report, package])
    [found] = json.loads(report.read_text())["install"]
    return tuple(map(int, re.findall(r"\d+", found["metadata"]["version"])))


def _virtual(home: Path, python: Path) -> Path:
    place = home / f"env-{python.name}"
    if not (place / "bin" / "python").exists():
        _get([python, "-m", "venv", place])
    return place / "bin" / "python"


def _program(*names: str, package: str = "", home: Path | None = None) -> str:
    """Return a program of this machine, or of a Debian package that is unpacked into a folder."""
    missing = [name for name in names if shutil.which(name) is None]
    if not missing:
        return names[0]
    if not package or home is None:
        raise UnavailableError(f"{missing[0]} is not installed")
    unpacked = home / "package" / "usr" / "bin" / names[0]
    if not unpacked.exists():
        _get(["apt-get", "download", package], cwd=home)
        [deb] = home.glob(f"{package}_*.deb")
        _get(["dpkg", "-x", deb, home / "package"])
    _get([unpacked, "--version"])
    return str(unpacked)


def _tried(words: list[object], **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a command, which may fail."""
    words = list(map(str, words))
    return subprocess.run(words, **{"capture_output": True, "text": True, "check": False, **how})


def _get(words: list[object], cwd: Path | None = None) -> None:
    try:
        _tried(words, cwd=cwd, check=True, timeout=PATIENCE_S)
    except subprocess.CalledProcessError as error:
        raise UnavailableError(error.stderr or error.stdout) from error
    except (OSError, subprocess.TimeoutExpired) as error:
        raise UnavailableError(str(error)) from error


def _said(words: list[object]) -> str:
    return _tried(words, check=True).stdout


def _attempted(attempt: Callable[[], str]) -> tuple[str, str]:
    """Return the report of an attempt, and its outcome."""
    try:
        return attempt(), "passed"
    except Exception as error:
        return "", f"FAILED: {str(error)[:200]}"


def _run(peer: str, words: list[object]) -> Iterator[Result]:
    """Run a script in a program's environment: each printed line is a version or a result."""
    environ = {**os.environ, "HF_HUB_OFFLINE": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    process = _tried(words, timeout=PATIENCE_S, env=environ)
    version, check = "", "starts"
    for line in process.stdout.splitlines():
        kind, _, text = line.partition(" ")
        if kind == "VERSION":
            version = text
        elif kind == "TRY":
            check = text
        elif kind == "PASSED":
            yield Result(peer, version, f"{check}{text}", "passed")
    if process.returncode:
        why = (process.stderr.strip().splitlines() or ["no reason"])[-1]
        yield Result(peer, version, check, f"FAILED: {why[:200]}")


def _import(peer: str, folder: Path) -> Result:
    told, outcome = _attempted(lambda: imports_of(folder))
    return Result(peer, "", f"comes in: {told}", outcome)


def _fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


if __name__ == "__main__":
    sys.exit(main())
