"""The causes of figures, requested from any process by a text, and compared in words."""

from __future__ import annotations

import inspect
import subprocess
import sys

from robot.lab import identity
from robot.lab.cluster import _WHO
from robot.lab.identity import MISSING, differences, identify_all

OURS = {"drivelesson": "aa", "Python": "3.12.1", "numpy": "2.0", "arithmetic": "11"}


def test_a_process_without_this_program_says_that_it_lacks_it() -> None:
    """Its own Python has neither this program nor numpy."""
    source = inspect.getsource(identity)
    program = f"source = {source!r}\nprint({_WHO}['drivelesson'])"
    command = [sys.executable, "-I", "-S", "-c", program]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said.strip() == MISSING
    assert eval(_WHO, {"source": source}) == identify_all()


def test_differences_are_said_with_both_versions() -> None:
    assert differences(OURS, OURS) == []
    bare = {**OURS, "drivelesson": MISSING, "numpy": MISSING}
    assert differences(OURS, bare) == ["it does not have Drivelesson"]
    other = {**OURS, "Python": "3.11.2", "numpy": "1.26", "arithmetic": "12", "plugin": "2"}
    assert differences(OURS, other) == [
        "Python 3.11.2 there, 3.12.1 here",
        "numpy 1.26 there, 2.0 here",
        "plugin 2 there, missing here",
    ]
    assert "its sums differ" in differences(OURS, {**OURS, "arithmetic": "12"})[0]
