"""The source code has the structure that docs/explanation/architecture.md describes."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from .extensions import PACKAGES, ROOT, modules

TESTS = ROOT / "tests"


def test_no_public_class_name_is_used_twice() -> None:
    places = defaultdict(list)
    for file in modules(ROOT):
        for name in re.findall(r"^class ([A-Za-z]\w*)", file.read_text("utf-8"), re.MULTILINE):
            places[name].append(file.relative_to(ROOT).as_posix())
    assert len(places) > 300
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_the_map_in_the_documents_shows_every_folder_in_its_layer(package: str) -> None:
    rooms = {
        path.stem
        for path in (ROOT / package).iterdir()
        if (path.suffix == ".py" and path.stem != "__init__") or (path / "__init__.py").is_file()
    }
    page = (ROOT / "docs/explanation/architecture.md").read_text("utf-8")
    found = re.search(rf"```layers {package}\n(.*?)```", page, re.DOTALL)
    assert found, f"architecture.md has no map of the layers of {package}"
    lines = [line.split("  ")[0] for line in found[1].splitlines() if line.strip()]
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    [layers] = [
        contract["layers"]
        for contract in settings["tool"]["importlinter"]["contracts"]
        if contract.get("containers") == [package]
    ]
    drawn, contracted = ([set(line.split(" | ")) for line in given] for given in (lines, layers))
    assert drawn == contracted and set().union(*drawn) == rooms
    assert len(list((ROOT / package).glob("*.py"))) <= 12 and len(rooms) <= 25


BREACHES = {
    "robot/learner/votes.py": ("import cv2", "import robot.devices.encoders"),
    "robot/policy/policy.py": ("import robot.control.gate",),
    "robot/store/models/store.py": ("import robot.devices.plugins",),
    "server/clients/hub.py": ("import server.routes.drive", "from robot.testing import FakeCamera"),
    "robot/errors.py": ("import server.protocol",),
    "robot/store/folder.py": ("import pydantic",),
    "robot/simulator/driver.py": ("import robot.exchange.replay_driver",),
}
"""Forbidden imports: of a higher or the same layer, out of the learner, into an extension."""


@pytest.mark.slow
def test_each_broken_import_contract_is_reported(tmp_path: Path) -> None:
    for folder in ("robot", "server", "tests/architecture"):
        unneeded = shutil.ignore_patterns("__pycache__", "*.toml")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=unneeded)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for module, lines in BREACHES.items():
        with (tmp_path / module).open("a") as file:
            file.write("\n".join(["", *lines, ""]))
    command = [str(Path(sys.executable).parent / "lint-imports"), "--no-cache"]
    broken = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert broken.returncode == 1
    said = broken.stdout.partition("Broken contracts")[2]
    for module, lines in BREACHES.items():
        importer = module.removesuffix(".py").replace("/", ".")
        arrow = "imports" if importer.startswith("robot.learner") else "->"
        for line in lines:
            assert f"{importer} {arrow} {line.split()[1]}" in said, said


CLOCKS = ("time.monotonic", "time.perf_counter", "time.time", "RealClock().now_s")
LEAST_S = 5.0


def hasty(source: str) -> Iterator[str]:
    """Yield each comparison of a measured real time with a limit below 5 s."""
    for scope in ast.walk(ast.parse(source)):
        if not isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        names: set[str] = set()

        def is_measured(node: ast.AST, names: set[str] = names) -> bool:
            return any(
                (isinstance(part, ast.Call) and ast.unparse(part.func) in CLOCKS)
                or (isinstance(part, ast.Name) and part.id in names)
                for part in ast.walk(node)
            )

        for node in ast.walk(scope):
            if isinstance(node, ast.Assign) and is_measured(node.value):
                names |= {name.id for name in node.targets if isinstance(name, ast.Name)}
        for node in ast.walk(scope):
            sides = [node.left, *node.comparators] if isinstance(node, ast.Compare) else []
            numbers = [side.value for side in sides if isinstance(side, ast.Constant)]
            small = [n for n in numbers if isinstance(n, int | float) and 0 < n < LEAST_S]
            if small and any(is_measured(side) for side in sides):
                yield f"line {node.lineno}: {ast.unparse(node)}"


def test_no_measured_time_is_compared_with_less_than_five_seconds() -> None:
    is_found = "def test():\n s = time.time()\n took = time.time() - s\n assert 2 >= took"
    assert [*hasty(is_found)] and not [*hasty(is_found.replace("2", "5.0"))]
    faults = [
        f"{path.relative_to(TESTS)}: {fault}"
        for path in sorted(TESTS.rglob("test_*.py"))
        if any(clock in (source := path.read_text("utf-8")) for clock in CLOCKS)
        for fault in hasty(source)
    ]
    assert faults == [], "no test may judge speed: `drivelesson bench` measures it"
