"""The import contracts can fail: each is broken once, in a copy of the source code."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BREACHES = {
    "a library in the learner": ("robot/learner/votes.py", "import cv2"),
    "our own code in the learner": ("robot/learner/votes.py", "import robot.devices.encoders"),
    "up in robot": ("robot/policy/policy.py", "import robot.control.gate"),
    "sideways in robot": ("robot/store/models/store.py", "import robot.devices.plugins"),
    "up in server": ("server/clients/hub.py", "import server.routes.drive"),
    "from robot to server": ("robot/errors.py", "import server.protocol"),
    "pydantic past the border": ("robot/store/folder.py", "import pydantic"),
    "a fake in the server": ("server/clients/hub.py", "from robot.testing import FakeCamera"),
    "from the core to an extension": (
        "robot/simulator/driver.py",
        "import robot.exchange.replay_driver",
    ),
}


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).parent / "lint-imports"), "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_each_broken_import_contract_is_reported(tmp_path: Path) -> None:
    for folder in ("robot", "server", "tests/architecture"):
        unneeded = shutil.ignore_patterns("__pycache__", "*.toml")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=unneeded)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    whole = lint(tmp_path)
    assert whole.returncode == 0, whole.stdout
    for module, line in BREACHES.values():
        file = tmp_path / module
        file.write_text(f"{file.read_text('utf-8')}\n{line}\n")
    broken = lint(tmp_path)
    assert broken.returncode == 1
    said = broken.stdout.partition("Broken contracts")[2]
    for name, (module, line) in BREACHES.items():
        importer, imported = module.removesuffix(".py").replace("/", "."), line.split()[1]
        arrow = "imports" if importer.startswith("robot.learner") else "->"
        assert f"{importer} {arrow} {imported}" in said, (name, said)
