"""The agent runs on the Python 3.5 of ev3dev's stock image, with only ev3dev2."""

from __future__ import annotations

import ast
import io
import sys
import zipfile
from pathlib import Path

from robot.bodies.ev3.archive import agent_sources, make_agent
from tests.kit.run import run

SOURCES = agent_sources()
VERMIN = (Path(sys.executable).with_name("vermin"), "--no-tips", "-t=3.5-")


def test_its_syntax_and_libraries_are_those_of_python_3_5(tmp_path: Path) -> None:
    for file in SOURCES.values():
        ast.parse(file.read_text(), str(file), feature_version=(3, 5))
    done = run(*VERMIN, "--eval-annotations", *SOURCES.values())
    assert done.returncode == 0, done.stdout
    assert "Minimum required versions: " in done.stdout
    newer = tmp_path / "newer.py"
    newer.write_text("x: int = 1\nprint(f'{x}')\n")
    assert run(*VERMIN, newer).returncode != 0, "and newer syntax would be found"


def _imports(text: str) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found


def test_it_imports_the_standard_library_ev3dev2_and_itself_alone() -> None:
    imported = set().union(*(_imports(file.read_text()) for file in SOURCES.values()))
    outside = {name for name in imported if name.partition(".")[0] not in sys.stdlib_module_names}
    carried = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", ".") for name in SOURCES
    }
    assert outside - carried == {"ev3dev2", "robot.errors"}, "the second it does without"


def test_the_archive_is_whole_and_the_same_each_time(tmp_path: Path) -> None:
    assert make_agent() == make_agent()
    names = set(zipfile.ZipFile(io.BytesIO(make_agent())).namelist())
    assert names >= {"__main__.py", *SOURCES}
    archive = tmp_path / "agent.pyz"
    archive.write_bytes(make_agent())
    done = run(sys.executable, "-I", "-S", archive, "--help", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "--secret-file" in done.stdout


def test_a_webcam_on_a_laptop_loads_nothing_of_the_brick() -> None:
    code = (
        "import sys, robot.bodies.v4l2.camera, robot.bodies.webcam.camera\n"
        "print([name for name in sys.modules if name.startswith('robot.bodies.ev3')])"
    )
    done = run(sys.executable, "-c", code)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr
