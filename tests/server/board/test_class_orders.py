"""`drivelesson class` gives orders, makes its ready-made lesson, and reports a port in use; see
also tests/e2e."""

import socket
from urllib.parse import urlsplit

import pytest

from robot.clock import RealClock
from robot.errors import ConfigurationError, NotConnectedError
from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from robot.testing import VirtualClock
from robot.types import Action
from server.board.app import create_board_app
from server.board.board import Board
from server.board.class_orders import give_order
from server.board.discovery import read_list
from server.board.ready_lesson import NAME, left_turns, locale_of_computer, name_of_left_turns
from server.board.transport import NetworkTransport
from server.cli.main import main
from server.config import Config
from server.lab.served import served
from tests.server.virtual_server import WEB

from .classroom_world import KEY


@pytest.mark.realtime
def test_the_command_gives_an_order_to_the_board_or_fails_with_one_sentence():
    config, clock = Config(port=0, web=WEB), RealClock()
    board = Board(KEY, NetworkTransport(), clock)
    with served(create_board_app(config, board, clock), config) as address:
        port = urlsplit(address).port
        for order in ("keep", "reset", "hand-over"):
            assert give_order(order, port) == (False, ["the board has no robots"])
        with pytest.raises(ConfigurationError, match="no order that can be undone"):
            give_order("undo", port)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        with pytest.raises(NotConnectedError, match=r"no board answers at .* give its port"):
            give_order("keep", nobody.getsockname()[1])


def test_a_port_in_use_is_reported_before_anything_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("server.hosting.logs.start_logging", lambda verbose: None)
    data = tmp_path / "data"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["class", "--lesson", "fair-data", "--port", port, "--data", str(data)]) == 1
    said = capsys.readouterr()
    assert f"port {port}: " in said.err and said.out == ""
    assert not data.exists()


@pytest.mark.parametrize(("encoding", "end"), [("utf-8", "\n"), ("utf-8-sig", "\r\n")])
def test_a_list_of_robots_is_read_whatever_editor_wrote_it(tmp_path, encoding, end):
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


def test_the_ready_made_lesson_has_no_right_turn_and_turns_left_at_a_wall(tmp_path):
    data = left_turns(seconds=30.0)
    store = ModelStore(Storage(tmp_path))
    model = store.load(store.add_file("left turns only", data))
    assert not model.summary.taught.get(Action.RIGHT) and Action.RIGHT in model.summary.moves
    assert model.summary.taught[Action.LEFT] > 50 < model.summary.taught[Action.FORWARD]
    policy, body = model.to_policy(), SimDriver(SimOptions(world="box", seed=3))
    body.connect()
    camera, done = SimCamera(body, SimCameraOptions(), VirtualClock()), []
    for step in range(100):
        frame = camera.take_jpeg()
        x, at_s = policy.extract(frame), 100 + step * 0.1
        action = policy.propose(frame.frame_id, x, at_s=at_s).action or Action.STOP
        done.append(action)
        body.drive(action)
        body.advance(0.1)
    body.disconnect()
    body.simulation.close()
    assert Action.RIGHT not in done and {Action.LEFT, Action.FORWARD} <= {*done}


def test_the_ready_made_lesson_has_a_name_in_the_language_of_the_computer():
    for locale in ("es_ES", "es.UTF-8", "es@euro", "Spanish_Spain"):
        assert name_of_left_turns(locale) == "solo izquierda"
    assert name_of_left_turns("zh_CN") == name_of_left_turns("Chinese_China") == "只会左转"
    assert {name_of_left_turns(locale) for locale in (None, "C", "de_DE")} == {NAME}
    environment = {"LC_ALL": "", "LANG": "es_MX.UTF-8"}  # this computer may lack the locale's files
    assert locale_of_computer(environment) == "es_MX.UTF-8"
    assert locale_of_computer(environment | {"LC_ALL": "zh_CN.UTF-8"}) == "zh_CN.UTF-8"
