"""The agent runs on the Python 3.5 of ev3dev's stock image, with nothing but ev3dev2."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

from robot.brick import agent

SOURCE = Path(agent.__file__)


def test_it_needs_no_more_than_python_3_5() -> None:
    ast.parse(SOURCE.read_text(), feature_version=(3, 5))
    done = subprocess.run(
        [
            Path(sys.executable).with_name("vermin"),
            "--no-tips",
            "--eval-annotations",
            "-t=3.5-",
            SOURCE,
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "Minimum required versions: " in done.stdout


def test_the_check_would_find_newer_syntax(tmp_path: Path) -> None:
    newer = tmp_path / "newer.py"
    newer.write_text("x: int = 1\nprint(f'{x}')\n")
    done = subprocess.run(
        [Path(sys.executable).with_name("vermin"), "--no-tips", "-t=3.5-", newer],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0


def test_it_imports_the_standard_library_and_ev3dev2_alone() -> None:
    imported = set()
    for node in ast.walk(ast.parse(SOURCE.read_text())):
        if isinstance(node, ast.Import):
            imported |= {name.name.partition(".")[0] for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add((node.module or "").partition(".")[0])
    assert imported - set(sys.stdlib_module_names) == {"ev3dev2"}
