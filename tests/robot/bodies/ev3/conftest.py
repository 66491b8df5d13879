"""A brick made of files, and an agent that runs on it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from tests.robot.bodies.ev3.running_agent import RunningAgent


@pytest.fixture
def brick(tmp_path: Path) -> Iterator[FakeBrick]:
    with FakeBrick(tmp_path / "brick") as fake:
        yield fake


@pytest.fixture
def running_agent(brick: FakeBrick, tmp_path: Path) -> Iterator[RunningAgent]:
    with RunningAgent(brick.root, tmp_path) as running:
        yield running
