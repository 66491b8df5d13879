"""Each extension can be taken away without a trace: the core's own tests pass where it never was.

By default a few quick ones; with DRIVELESSON_EXTENSIONS=all every quick one that does not use the
extension.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

import robot

from .extensions import EXTENSIONS

ROOT = Path(__file__).parents[2]
QUICK = ("tests/robot/control/test_gate.py", "tests/server/clients/test_lease.py")
QUICK += ("tests/server/cli/test_main.py", "tests/robot/devices/test_options.py")
EVERYTHING = ("tests/robot", "tests/server", "tests/faults", "tests/contract")


def packages_of(extension: str) -> set[str]:
    """Return the packages of an extension."""
    return {f"robot.{extension}", f"server.{extension}"}


def imports(module: str, file: Path) -> set[str]:
    """Return the modules that a module names in its imports, and what it takes from them."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom):
            base = module.split(".")[: -node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            found |= {source, *(f"{source}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found


@cache
def imports_of_tests() -> dict[str, set[str]]:
    """Return every module of the tests with all that it imports, also through other tests.

    The `conftest` of its folder, and of those above, counts as imported.
    """
    files = {
        ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
        for file in (ROOT / "tests").rglob("*.py")
        if "node_modules" not in file.parts
    }
    direct = {name: imports(name, file) | fixtures(name) for name, file in files.items()}

    whole = {}
    for name in direct:
        seen, todo = {name}, [name]
        while todo:
            new = (direct[todo.pop()] & direct.keys()) - seen
            seen |= new
            todo += new
        whole[name] = set().union(*(direct[each] for each in seen))
    return whole


def fixtures(module: str) -> set[str]:
    """Return where a test's fixtures may come from, existing or not."""
    parts = module.split(".")
    return {".".join([*parts[:depth], "conftest"]) for depth in range(1, len(parts))}


def uses(names: set[str], packages: set[str]) -> bool:
    return any(name == each or name.startswith(f"{each}.") for name in names for each in packages)


def copy_without(extension: str, folder: Path) -> set[str]:
    """Copy the tree without an extension; return the packages that are gone."""
    gone = packages_of(extension)
    ignored = shutil.ignore_patterns("__pycache__", "node_modules", "*.webp")
    for name in ("robot", "server", "web", "tests", "docs"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for package in gone:
        for path in (package.replace(".", "/"), f"tests/{package.replace('.', '/')}"):
            shutil.rmtree(folder / path, ignore_errors=True)
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    taken = "|".join(map(re.escape, sorted(gone)))
    text = re.sub(rf'^[\w-]+ = "(?:{taken})[.:].*\n', "", text, flags=re.MULTILINE)
    (folder / "pyproject.toml").write_text(text, "utf-8")
    groups = tomllib.loads(text)["project"]["entry-points"]
    installed = folder / "drivelesson-0.dist-info"
    installed.mkdir()
    about = f"Metadata-Version: 2.1\nName: drivelesson\nVersion: {robot.__version__}\n"
    (installed / "METADATA").write_text(about)
    (installed / "entry_points.txt").write_text(
        "\n".join(
            f"[{group}]\n" + "\n".join(f"{name} = {target}" for name, target in points.items())
            for group, points in groups.items()
        )
    )
    return gone


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_the_core_works_without(extension: str, tmp_path: Path) -> None:
    gone = copy_without(extension, tmp_path)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}

    def run(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", *words],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
        return done.stdout

    told = run("server", "--help")
    assert "serve" in told
    homes = {"board": "board", "study": "study", "evaluate": "lab", "learn": "lab"}
    for name, at_home in {**homes, "brick": "bodies"}.items():
        assert (f"  {name} " in told) is (not uses({f"server.{at_home}"}, gone))
    everything = os.environ.get("DRIVELESSON_EXTENSIONS") == "all"
    folders = tuple(f"{folder}/" for folder in (EVERYTHING if everything else QUICK))
    kept = [
        path
        for name, names in sorted(imports_of_tests().items())
        if name.rpartition(".")[2].startswith("test_")
        and not uses({name.removeprefix("tests.")}, set().union(*map(packages_of, EXTENSIONS)))
        and not uses({each.removeprefix("tests.") for each in {name, *names}}, gone)
        and f"{(path := name.replace('.', '/') + '.py')}/".startswith(folders)
    ]
    assert kept
    without = ["cacheprovider", "randomly"]
    if uses({"robot.testing"}, gone):  # The installed program still names its plugin of pytest.
        without.append("drivelesson")
    options = [option for plugin in without for option in ("-p", f"no:{plugin}")]
    quick = "not slow and not browser and not realtime"
    printed = run("pytest", "-q", *options, "-m", quick, *kept)
    assert " passed" in printed
