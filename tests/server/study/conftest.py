import pytest

from tests.server.virtual_server import VirtualServer


@pytest.fixture
def server(tmp_path):
    """A robot that saves its data in the test's folder."""
    with VirtualServer(data=tmp_path) as running:
        yield running
