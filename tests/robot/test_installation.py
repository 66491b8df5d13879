"""How the program was installed, its advice for that case, and other packages called `robot`."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

import robot
from robot import errors
from robot.errors import MissingExtraError

ROOT = Path(__file__).parents[2]


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    # Without site-packages, so only the folder's packages are seen.
    command = [
        sys.executable,
        "-S",
        *words,
    ]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def copy_of_packages(folder: Path) -> Path:
    for package in ("robot", "server"):
        shutil.copytree(ROOT / package, folder / package)
    return folder


def test_the_version_is_that_of_the_distribution() -> None:
    assert robot.__version__ == importlib.metadata.version("drivelesson")


PIP = (f"{sys.executable} -m pip install ", f"uv pip install --python {sys.executable} ")
"""If pip itself is missing, uv has made the environment."""


def quoted(word: str) -> str:
    return f"'{word}'" if os.name != "nt" or " " in word else word


def test_in_a_clone_the_advice_installs_from_the_clone() -> None:
    command = errors.install_command("ev3")
    assert command in [f"{pip}--editable {quoted(f'{ROOT}[ev3]')}" for pip in PIP]


@pytest.mark.parametrize(
    "source", [None, "file:///C:/Users/A%20B/drivelesson-0.3.0-py3-none-any.whl"]
)
def test_on_windows_the_advice_has_the_quotes_that_both_its_shells_know(
    monkeypatch: pytest.MonkeyPatch, source: str | None
) -> None:
    monkeypatch.setattr(errors, "os", SimpleNamespace(name="nt"))
    monkeypatch.setattr(errors, "_clone", lambda: None)
    monkeypatch.setattr(errors, "_source", lambda: source)
    monkeypatch.setattr(sys, "executable", r"C:\Users\A B\python.exe")
    command = errors.install_command("ev3")
    assert "'" not in command and r'C:\Users\"A B"\python.exe' in command
    assert not command.startswith('"'), "PowerShell would print it"
    wanted = f'"drivelesson[ev3] @ {source}"' if source else "drivelesson[ev3]"
    assert command.endswith(f" {wanted}")


@pytest.mark.parametrize(
    ("prefix", "begins"),
    [
        ("/home/me/.local/share/uv/tools/drivelesson", "uv tool install --force "),
        ("/home/me/.cache/uv/archive-v0/x1", "uvx --from "),
        ("/home/me/.local/share/pipx/venvs/drivelesson", "pipx install --force "),
        ("/home/me/venv", PIP),
    ],
)
@pytest.mark.parametrize("source", [None, "file:///tmp/drivelesson-0.1.0-py3-none-any.whl"])
def test_elsewhere_it_is_for_the_tool_that_installed_it(
    monkeypatch: pytest.MonkeyPatch, prefix: str, begins: str | tuple[str, ...], source: str | None
) -> None:
    monkeypatch.setattr(sys, "prefix", prefix)
    monkeypatch.setattr(errors, "_clone", lambda: None)
    monkeypatch.setattr(errors, "_source", lambda: source)
    wanted = f"drivelesson[ev3] @ {source}" if source else "drivelesson[ev3]"
    command = errors.install_command("ev3")
    assert command.startswith(begins)
    assert command.replace('"', "'").removesuffix(" drivelesson").endswith(f" {quoted(wanted)}")
    assert command in str(MissingExtraError("driving", "ev3"))


def test_the_extra_that_an_error_names_brings_the_library() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    text = "".join(
        f.read_text("utf-8") for d in ("robot", "server") for f in (ROOT / d).rglob("*.py")
    )
    told = re.findall(r'need\("([\w.]+)", f?"[^"]*", "([\w-]+)"\)', text)
    assert len(told) > 10
    for library, extra in told:
        brought = " ".join([*project["dependencies"], *project["optional-dependencies"][extra]])
        assert library.split(".")[0].replace("cv2", "opencv") in brought, (library, extra)


def test_beside_robot_framework_importing_ends_in_a_sentence(tmp_path: Path) -> None:
    folder = copy_of_packages(tmp_path)
    (folder / "robot/running").mkdir()  # as Robot Framework has it
    done = run(folder, "-c", "import robot")
    assert "ImportError: Robot Framework and Drivelesson" in done.stderr.splitlines()[-1]
    done = run(folder, "-m", "server")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("drivelesson: Robot Framework and Drivelesson")


def test_where_robot_framework_came_last_the_command_says_so(tmp_path: Path) -> None:
    folder = copy_of_packages(tmp_path)
    (folder / "robot/__init__.py").write_text("__version__ = '7.0'\n")
    (folder / "robot/errors.py").write_text("")
    done = run(folder, "-m", "server")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "is another project's" in done.stderr and "pipx" in done.stderr
