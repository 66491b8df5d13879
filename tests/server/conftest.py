from __future__ import annotations

from collections.abc import Iterator

import pytest

from .live_robot import LiveServer, live_server


@pytest.fixture
def server() -> Iterator[LiveServer]:
    with live_server() as running:
        yield running
