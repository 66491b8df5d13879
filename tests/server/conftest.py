from __future__ import annotations

from collections.abc import Iterator

import pytest

from .virtual_server import VirtualServer


@pytest.fixture
def server() -> Iterator[VirtualServer]:
    with VirtualServer() as running:
        yield running
