"""One press saves, resets, hands over or copies the models of a class, and can be undone.

The message of each failure says what has not changed.
"""

import asyncio
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from robot.errors import NotFoundError
from robot.store.models.model import encode_model, take_model
from robot.testing import VirtualClock
from robot.types import Mode
from server.access.pairing import Pairing
from server.board.class_models import ClassModels, ClassOrder
from server.board.classroom import Classroom
from server.board.model_copy import copy_model
from server.board.robot_link import RobotLink
from server.board.teacher_session import Status, TeacherSession
from server.board.transport import HttpAnswer, RobotAddress, ServerPlace, UnreachableError
from server.config import Config
from tests.server.virtual_server import WEB, VirtualServer

from .classroom_world import KEY, Absent, VirtualNetwork


def linked(number: int, port: int, network: Any, clock: VirtualClock) -> RobotLink:
    """Return a board's link to a robot, with a session that the board already has."""
    session = TeacherSession(RobotAddress("127.0.0.1", port), KEY, network)
    link = RobotLink(number, session, clock, lambda *_: None, lambda *_: None, asyncio.Event())
    session.place, session._secret = ServerPlace(session.address, ""), "s"
    link.name, link.status, link.state = f"R{number}", Status.THERE, {"mode": "stopped"}
    return link


class Class:
    """A board with a real robot, and with robots that have disappeared, refuse, or are away."""

    def __init__(self, data: Path) -> None:
        self.pairing = Pairing(10)
        self.pairing.standing_code = KEY.code
        config, options = Config(port=0, web=WEB, data=data), {"classroom": Classroom(KEY)}
        self.server = VirtualServer(config, self.pairing, data, name="R1", options=options)

    def meet(self) -> None:
        robots = [self.server, Absent(1, "gone"), Absent(2, "refuses"), Absent(3, "gone")]
        network = VirtualNetwork({one.port: one for one in robots}, self.server.dice)
        self.links = [
            linked(number, one.port, network, self.server.clock)
            for number, one in enumerate(robots, 1)
        ]
        self.link, self.links[-1].status = self.links[0], Status.AWAY
        self.server.run(self.link._session.join())
        self.models = ClassModels(lambda: self.links, self.server.clock)

    @property
    def lessons(self) -> int:
        return self.server.ask_loop(lambda: self.server.rig.loop.history.taught.total())

    def names(self) -> list[str]:
        return sorted(self.server.persistence.models.names())

    def give(self, order: ClassOrder, *more: Any) -> list[dict[str, Any]]:
        return self.server.run(self.models.give(order, *more))["robots"]

    def undo(self) -> list[dict[str, Any]]:
        return self.server.run(self.models.undo())["robots"]

    def phone(self) -> str:
        return self.pairing.redeem(KEY.code, self.server.clock.now_s()).secret


@pytest.fixture
def group(tmp_path):
    made = Class(tmp_path)
    with made.server:
        made.meet()
        yield made


@pytest.mark.parametrize("order", ClassOrder)
def test_an_orders_result_is_listed_for_each_robot_and_can_be_undone(order, group):
    phone = group.phone()
    group.server.teach(12)
    group.server.persistence.autosave.save()
    given = group.server.persistence.models.read_file("R1") if order is ClassOrder.LOAD else b""
    ours, gone, odd, away = group.give(order, given, "left turns")
    assert (ours["name"], ours["did"]) == ("R1", order.value) and ours["model"]
    assert [one["did"] for one in (gone, odd, away)] == ["away", "failed", "away"]
    assert gone["name"] == "R2" and "refused" in gone["detail"]
    assert group.models.describe() == {"order": order.value, "robots": [ours, gone, odd, away]}
    assert group.lessons == (0 if order in (ClassOrder.RESET, ClassOrder.HAND_OVER) else 12)
    assert len(group.names()) == 2 and "R1" in group.names(), "every model is still there"
    assert (group.pairing.find(phone) is None) is (order is ClassOrder.HAND_OVER)
    [back] = group.undo()
    assert (back["number"], back["did"]) == (1, "undone")
    assert group.lessons == 12 and group.names() == ["R1"]
    assert group.pairing.find(phone) is not None
    assert group.models.describe() == {"order": None, "robots": []}
    with pytest.raises(NotFoundError):
        group.undo()


def test_a_robot_that_was_never_taught_saves_nothing_before_a_lesson(group):
    given = encode_model(take_model(group.server.rig.loop.history.policy, {"left": 3}))
    group.link.state = {"mode": "stopped", "lessons": 0}
    group.give(ClassOrder.LOAD, given, "left turns")
    assert group.names() == ["left turns"]
    assert group.undo()[0]["did"] == "undone"
    assert group.names() == ["R1"], "the model in use is empty again"


def test_a_robot_without_examples_saves_nothing_and_never_has_two_empty_models(group):
    group.server.teach(12)
    given = group.server.persistence.models.read_file(group.server.persistence.autosave.save())
    group.give(ClassOrder.RESET)
    group.link.state = {"mode": "stopped", "lessons": 0}
    assert group.give(ClassOrder.KEEP)[0]["did"] == "empty"
    for order in (ClassOrder.RESET, ClassOrder.HAND_OVER, ClassOrder.RESET):
        ours, *_ = group.give(order)
        assert (ours["did"], ours["model"]) == (order.value, "")
        assert len(group.names()) == 2, "the folder has the taught model and the empty one in use"
    ours, *_ = group.give(ClassOrder.LOAD, given, "left turns")
    assert ours["model"] == "" and group.names() == ["R1", "left turns"]
    ours, *_ = group.give(ClassOrder.RESET)  # the update about the examples is still in transit
    assert ours["model"] == "left turns" and "left turns" in group.names()
    group.undo()
    assert group.names() == ["R1", "left turns"]
    for left in (0, 0, 0, 0, 12):
        [back] = group.undo()
        assert back["did"] == "undone", back
        assert group.lessons == left
    assert group.names() == ["R1"]


def test_later_teaching_survives_an_undo_which_can_be_repeated_for_absent_robots(group):
    group.server.teach(12)
    group.give(ClassOrder.RESET)
    group.server.teach(3)
    for fault, did in (("gone", "away"), ("none", "undone")):
        group.server.fault = fault
        assert [one["did"] for one in group.undo()] == [did]
    assert group.lessons == 12 and len(group.names()) == 2


def test_a_robot_that_drives_is_stopped_first_and_one_that_does_not_stop_is_left_alone(group):
    group.server.teach(12)
    link, press = group.link, group.link.stop.press
    link.state, link.stop.press = {"mode": "train"}, lambda now_s: None
    outcome, *_ = group.give(ClassOrder.RESET)
    assert outcome["did"] == "away" and "did not stop" in outcome["detail"]
    assert group.lessons == 12
    link.stop.press = press
    group.server.set_mode(Mode.TRAIN)
    outcome, *_ = group.give(ClassOrder.RESET)
    assert outcome["did"] == "reset" and group.lessons == 0
    assert group.server.rig.loop.state.emergency, "the stop stays until the teacher releases it"
    link.stop.close()


GONE = UnreachableError("the robot's answer is incomplete")
REFUSED = HttpAnswer(409, b'{"detail": "Stop the robot first."}')
EMPTY = HttpAnswer(200, b"[]")
GOOD = {
    "save": HttpAnswer(200, b'{"name": "K\xc3\xbcche"}'),
    "get": HttpAnswer(200, b"the model"),
    "put": HttpAnswer(201, '{"name": "Küche 2"}'.encode()),
    "load": HttpAnswer(200, b"{}"),
}


class Robots:
    """Robots that answer like real robots, except that one of them fails in one step."""

    def __init__(self, step: str, fault: HttpAnswer | Exception) -> None:
        self.step, self.fault = step, fault
        self.kept: dict[int, bytes] = {}
        self.loaded: dict[int, str] = {}

    async def request(
        self, place: ServerPlace, method: str, path: str, headers: Any, body: bytes = b""
    ) -> HttpAnswer:
        port, last = place.address.port, path.rpartition("/")[2]
        step = last if last in ("save", "load") else method.lower()
        if step == self.step and port == (1 if step in ("save", "get") else 2):
            if isinstance(self.fault, HttpAnswer):
                return self.fault
            raise self.fault
        if step == "put":
            self.kept[port] = body
        if step == "load":
            self.loaded[port] = path
        return GOOD[step]


@pytest.mark.parametrize(
    ("step", "fault"),
    [
        *(("save", GONE), ("save", EMPTY), ("get", TimeoutError()), ("get", REFUSED)),
        *(("put", REFUSED), ("put", EMPTY), ("load", GONE), ("load", TimeoutError())),
        ("load", REFUSED),
    ],
)
def test_a_failed_copy_is_named_and_the_other_robots_get_the_model(step, fault):
    robots = Robots(step, fault)
    one, two, three = (linked(n, n, robots, VirtualClock()) for n in (1, 2, 3))
    [said] = asyncio.run(copy_model(one, [two, three]))
    assert 2 not in robots.loaded
    if step in ("save", "get"):
        assert "R1 did not send its model" in said and not robots.kept
    else:
        assert robots.loaded == {3: f"/api/models/{quote('Küche 2')}/load"}
        assert robots.kept[3] == b"the model"
        assert "R2" in said and ("stored the model as Küche 2" in said) is (step == "load")
    assert fault is not REFUSED or "Stop the robot first." in said
