"""A measured server that does not end is killed, and the benchmark reports it."""

from __future__ import annotations

import threading
from multiprocessing.connection import Connection

import pytest

from robot.errors import ConfigurationError
from server.lab.bench import subject
from server.lab.bench.subject import ServerUnderTest


def serve_for_ever(line: Connection, kind: str, rate_hz: float) -> None:
    """Stay alive although the pipe is closed."""
    line.send(8080)
    threading.Event().wait()


def test_a_server_that_does_not_end_is_killed_and_this_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(subject, "_serve", serve_for_ever)
    served = ServerUnderTest("drivelesson", 30.0)
    with pytest.raises(ConfigurationError, match="had not ended after 60 s"), served:
        monkeypatch.setattr(served._process, "join", lambda patience_s: None)
    monkeypatch.undo()
    served._process.join()
    assert served._process.exitcode, "it was killed"
