"""The source code has the layout that docs/explanation/architecture.md describes."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest

from robot.control.loop import ControlLoop
from robot.policy.registry import make_policy
from robot.simulator.driver import SimDriver, SimOptions
from robot.testing import VirtualClock
from tests.robot.bench_robot import BenchCamera

from . import rules

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/explanation/architecture.md"


def test_no_public_class_name_is_used_twice() -> None:
    assert rules.classes_used_twice(ROOT) == {}


def test_a_class_name_used_twice_is_found(tmp_path: Path) -> None:
    for name in ("robot/one", "robot/two", "server/three"):
        file = tmp_path / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text("class Once: ...\nclass _Private: ...\n".replace("Once", f"C{name[-1]}"))
    assert rules.classes_used_twice(tmp_path) == {
        "Ce": ["robot/one.py", "server/three.py"],
    }


@pytest.mark.parametrize("package", rules.PACKAGES)
def test_the_map_in_the_documents_shows_every_folder(package: str) -> None:
    drawn = rules.drawn_layers(ROOT, package)
    assert set().union(*drawn) == rules.rooms(ROOT, package)
    assert drawn == rules.contracted_layers(ROOT, package)


@pytest.mark.parametrize("package", rules.PACKAGES)
def test_few_modules_are_outside_of_packages(package: str) -> None:
    assert len(list((ROOT / package).glob("*.py"))) <= 12
    assert len(rules.rooms(ROOT, package)) <= 25


PASSES_BY = {
    "robot/camera.py": "_publish",
    "robot/control/cycle.py": "_look",
    "robot/control/online_learning.py": "look",
    "robot/policy/policy.py": "propose",
    "robot/control/gate.py": "select",
    "robot/simulator/driver.py": "_drive",
}
"""The function of each module by which a frame, or data made from it, is passed on."""


def test_a_frame_goes_from_camera_to_motor_by_the_modules_that_the_page_names() -> None:
    section = PAGE.read_text("utf-8").split("## The way of one frame")[1].split("\n## ")[0]
    named = re.findall(r"^\d\. `([\w/]+\.py)`", section, re.MULTILINE)
    assert len(named) <= 6 and set(named) == set(PASSES_BY)

    clock = VirtualClock(100.0)
    driver, camera = SimDriver(SimOptions()), BenchCamera(clock)
    driver.connect()
    loop = ControlLoop(driver, camera, make_policy("default-8"), clock)
    passed: list[str] = []

    def note(frame: Any, event: str, _: object) -> None:
        file = Path(frame.f_code.co_filename)
        name = file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else ""
        if event == "call" and frame.f_code.co_name == PASSES_BY.get(name):
            passed.append(name)

    sys.setprofile(note)
    try:
        camera.show(1)
        loop.tick(clock.now_s())
    finally:
        sys.setprofile(None)
    assert passed == named
