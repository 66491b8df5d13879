"""The how-to about the library, and the README's example, run as they are written."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from tests.kit.sizes import only_full

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/howto/use-from-python.md"
PROGRAM = """\
import numpy as np
from robot.learner import BSOC, BSOCClassifier, Evidence, Learner, PublishedBSOC

learner: Learner = BSOCClassifier(max_nodes=4)
learner.learn_one(np.zeros(3), "left")
evidence: Evidence = learner.explain_one(np.ones(3))
label: str = evidence.label
clusters: list[BSOC | PublishedBSOC] = [BSOC(4), PublishedBSOC(4)]
numbers: list[int] = [cluster.train(np.ones(3, np.float32)) for cluster in clusters]
print(label, numbers)
"""


def test_the_page_prints_what_it_says(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    command = [sys.executable, "-c", "\n".join(blocks)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    said = re.findall(r"The example prints (.*?)\.(?: |\n)", PAGE.read_text("utf-8"), re.DOTALL)
    promised = [line for sentence in said for line in re.findall(r"`([^`]+)`", sentence)]
    assert done.stdout.splitlines() == promised


def test_the_readme_prints_what_it_says() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert len([line for line in code.splitlines() if line and "numpy" not in line]) == 5
    assert done.stderr == ""
    assert done.stdout.splitlines() == re.findall(r"# (\w+)$", code, re.MULTILINE) == ["left"]


@only_full
def test_a_users_program_passes_a_strict_type_check(tmp_path: Path) -> None:
    file = tmp_path / "program.py"
    file.write_text(PROGRAM)
    mypy = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path), str(file)]
    checked = subprocess.run(mypy, cwd=ROOT, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout
    ran = subprocess.run(
        [sys.executable, file], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ran.stdout == "left [0, 0]\n"
