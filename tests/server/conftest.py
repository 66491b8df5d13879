from collections.abc import Callable

import pytest

from robot.store.folder import Storage
from server.__main__ import main
from tests.robot.recordings.drives import record_drive

from .virtual_server import VirtualServer


@pytest.fixture
def server():
    with VirtualServer() as running:
        yield running


Say = Callable[..., str]


@pytest.fixture
def say(capsys):
    """Run a command as a user types it; return its output, or its errors if the status is not 0."""

    def run(words: str, status: int = 0) -> str:
        assert main(words.split()) == status
        captured = capsys.readouterr()
        return captured.out if status == 0 else captured.err

    return run


@pytest.fixture
def data(tmp_path, monkeypatch):
    """The folder that commands use by default."""
    monkeypatch.setenv("DRIVELESSON_DATA", str(tmp_path / "data"))
    return tmp_path / "data"


@pytest.fixture
def episode_id(data):
    """A recorded drive in this folder."""
    return record_drive(Storage(data).folder("episodes"), "default-8").id
