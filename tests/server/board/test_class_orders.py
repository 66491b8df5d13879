"""`drivelesson class` with an order, or with a port in use; see also tests/e2e."""

from __future__ import annotations

import socket
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from robot.clock import RealClock
from robot.errors import ConfigurationError, NotConnectedError
from server.board.app import create_board_app
from server.board.board import Board
from server.board.class_orders import give_order
from server.board.discovery import read_list
from server.board.transport import NetworkTransport
from server.cli.main import main
from server.config import Config
from server.lab.served import served
from tests.server.conftest import Say
from tests.server.virtual_server import WEB

from .classroom_world import KEY


@pytest.mark.realtime
def test_the_command_gives_an_order_to_the_board_or_fails_with_one_sentence() -> None:
    config, clock = Config(port=0, web=WEB), RealClock()
    board = Board(KEY, NetworkTransport(), clock)
    with served(create_board_app(config, board, clock), config) as address:
        port = urlsplit(address).port
        assert port is not None
        for order in ("keep", "reset", "hand-over"):
            assert give_order(order, port) == (False, ["the board has no robots"])
        with pytest.raises(ConfigurationError, match="no order that can be undone"):
            give_order("undo", port)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        with pytest.raises(NotConnectedError, match=r"no board answers at .* name its port"):
            give_order("keep", nobody.getsockname()[1])


def test_a_port_in_use_is_reported_before_anything_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("server.hosting.logs.start_logging", lambda verbose: None)
    data = tmp_path / "data"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["class", "--lesson", "fair-data", "--port", port, "--data", str(data)]) == 1
    said = capsys.readouterr()
    assert f"port {port}: " in said.err and said.out == ""
    assert not data.exists()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_list_of_robots_is_read_whatever_editor_wrote_it(
    tmp_path: Path, encoding: str, end: str
) -> None:
    file = tmp_path / "robots.txt"
    lines = (
        "kitchen.local:8000 # Müllers",
        "",
        "# the hall",
        "10.0.0.7:8001",
        "kitchen.local:8000",
    )
    file.write_bytes((end.join(lines) + end).encode(encoding))
    assert read_list(str(file)) == read_list("kitchen.local:8000,10.0.0.7:8001")


def test_a_missing_list_is_reported_in_one_clear_line(say: Say) -> None:
    told = say("board --robots /nowhere/robots.txt", status=2)
    assert "robots.txt: No such file" in told.splitlines()[-1]
