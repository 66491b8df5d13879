"""A brick made of files, and an agent for it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from robot.bodies.ev3.fake_brick import FakeBrick
from robot.testing import VirtualClock
from tests.robot.bodies.ev3.virtual_agent import VirtualAgent


@pytest.fixture
def brick(tmp_path: Path) -> Iterator[FakeBrick]:
    """A brick in virtual time, because brick and driver are in one process."""
    with FakeBrick(tmp_path / "brick", clock=VirtualClock(100.0)) as fake:
        yield fake


@pytest.fixture
def real_brick(tmp_path: Path) -> Iterator[FakeBrick]:
    """A brick in real time, for agents and servers in other processes."""
    with FakeBrick(tmp_path / "brick") as fake:
        yield fake


@pytest.fixture
def agent(brick: FakeBrick) -> Iterator[VirtualAgent]:
    with VirtualAgent(brick) as running:
        yield running
