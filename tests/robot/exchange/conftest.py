from __future__ import annotations

import pytest

from robot.recordings.episode import Episode, open_episode

from .sim_drive import drive_in_simulator


@pytest.fixture(scope="session")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    """A drive in the simulator, which no test may change."""
    return open_episode(
        drive_in_simulator(tmp_path_factory.mktemp("sim"), "default-8", steps=120).path
    )
