from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.server.virtual_server import VirtualServer


@pytest.fixture
def server(tmp_path: Path) -> Iterator[VirtualServer]:
    """A robot that saves in the test's folder."""
    with VirtualServer(data=tmp_path) as running:
        yield running
