"""The ready-made lesson: a robot that was never taught a right turn, and its behaviour."""

from __future__ import annotations

from pathlib import Path

from robot.simulator.camera import SimCamera, SimCameraOptions
from robot.simulator.driver import SimDriver, SimOptions
from robot.store.folder import Storage
from robot.store.models.store import ModelStore
from robot.testing import VirtualClock
from robot.types import Action
from server.board.ready_lesson import NAME, left_turns, locale_of_computer, name_of_left_turns


def test_the_ready_made_lesson_has_no_right_turn_and_turns_left_at_a_wall(tmp_path: Path) -> None:
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


def test_the_ready_made_lesson_has_a_name_in_the_language_of_the_computer() -> None:
    for locale in ("es_ES", "es.UTF-8", "es@euro", "Spanish_Spain"):
        assert name_of_left_turns(locale) == "solo izquierda"
    environment = {"LC_ALL": "", "LANG": "es_MX.UTF-8"}  # this computer may lack the locale's files
    assert name_of_left_turns(locale_of_computer(environment)) == "solo izquierda"
    assert locale_of_computer(environment | {"LC_ALL": "zh_CN.UTF-8"}) == "zh_CN.UTF-8"
    assert name_of_left_turns("zh_CN") == name_of_left_turns("Chinese_China") == "只会左转"
    assert (
        name_of_left_turns(None) == name_of_left_turns("C") == name_of_left_turns("de_DE") == NAME
    )
