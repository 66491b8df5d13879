"""All robots of a class keep, reset or hand over their models at one press, with undo."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from robot.errors import NotFoundError
from robot.store.models.model import encode_model, take_model
from robot.types import Mode
from server.access.pairing import Paired, Pairing
from server.board.class_models import ClassModels, ClassOrder
from server.board.classroom import Classroom
from server.board.robot_link import RobotLink
from server.board.teacher_session import Status, TeacherSession
from server.board.transport import RobotAddress
from server.config import Config
from tests.server.virtual_server import WEB, VirtualServer

from .classroom_world import KEY, VirtualNetwork


class _Elsewhere:
    """A robot whose answers differ from those of ours."""

    def __init__(self, port: int, fault: str) -> None:
        self.port, self.fault = port, fault


class _Class:
    """One real robot, one that has just disappeared, one that refuses, and one that is away."""

    def __init__(self, data: Path) -> None:
        self.pairing = Pairing(10)
        self.pairing.standing_code = KEY.code
        config, options = Config(port=0, web=WEB, data=data), {"classroom": Classroom(KEY)}
        self.server = VirtualServer(config, self.pairing, data, name="R1", options=options)
        self.links: list[RobotLink] = []

    def meet(self) -> ClassModels:
        server = self.server
        others = [_Elsewhere(1, "gone"), _Elsewhere(2, "refuses"), _Elsewhere(3, "gone")]
        pupils = {one.port: one for one in (server, *others)}
        server.fault = "none"  # type: ignore[attr-defined]
        network: Any = VirtualNetwork(pupils, server.dice)

        async def join() -> ClassModels:
            for number, port in enumerate(pupils, 1):
                session = TeacherSession(RobotAddress("127.0.0.1", port), KEY, network)
                news = (lambda *_: None, lambda *_: None, asyncio.Event())
                link = RobotLink(number, session, server.clock, *news)
                link.name, link.status, link.state = f"R{number}", Status.THERE, {"mode": "stopped"}
                if port == server.port:
                    await session.join()
                else:
                    session.place, session._secret = await network.locate(link.address), "s"
                self.links.append(link)
            self.links[-1].status = Status.AWAY
            return ClassModels(lambda: self.links, server.clock)

        return server.run(join())

    @property
    def lessons(self) -> int:
        return self.server.ask_loop(lambda: self.server.rig.loop.history.taught.total())

    def names(self) -> list[str]:
        return sorted(self.server.persistence.models.names())

    def give(self, models: ClassModels, order: ClassOrder, *more: Any) -> list[dict[str, Any]]:
        robots: list[dict[str, Any]] = self.server.run(models.give(order, *more))["robots"]
        return robots

    def undo(self, models: ClassModels) -> list[dict[str, Any]]:
        robots: list[dict[str, Any]] = self.server.run(models.undo())["robots"]
        return robots

    def phone(self) -> str:
        paired = self.pairing.redeem(KEY.code, self.server.clock.now_s())
        assert isinstance(paired, Paired)
        return paired.secret


@pytest.mark.parametrize(
    "order", [ClassOrder.KEEP, ClassOrder.RESET, ClassOrder.HAND_OVER, ClassOrder.LOAD]
)
def test_an_orders_result_is_listed_for_each_robot_and_can_be_undone(
    order: ClassOrder, tmp_path: Path
) -> None:
    group = _Class(tmp_path)
    with group.server:
        models, phone = group.meet(), group.phone()
        group.server.teach(12)
        group.server.persistence.autosave.save()
        given = group.server.persistence.models.read_file("R1") if order is ClassOrder.LOAD else b""
        ours, gone, odd, away = group.give(models, order, given, "left turns")
        assert (ours["name"], ours["did"]) == ("R1", order.value) and ours["model"]
        assert [one["did"] for one in (gone, odd, away)] == ["away", "failed", "away"]
        assert gone["name"] == "R2" and "refused" in gone["detail"]
        assert models.describe() == {"order": order.value, "robots": [ours, gone, odd, away]}
        assert group.lessons == (0 if order in (ClassOrder.RESET, ClassOrder.HAND_OVER) else 12)
        assert len(group.names()) == 2 and "R1" in group.names(), "nothing is lost"
        is_signed_out = group.pairing.find(phone) is None
        assert is_signed_out is (order is ClassOrder.HAND_OVER)
        [back] = group.undo(models)
        assert (back["number"], back["did"]) == (1, "undone")
        assert group.lessons == 12 and group.names() == ["R1"]
        assert group.pairing.find(phone) is not None
        assert models.describe() == {"order": None, "robots": []}
        with pytest.raises(NotFoundError):
            group.undo(models)


def test_a_robot_without_examples_saves_nothing_and_never_has_two_empty_models(
    tmp_path: Path,
) -> None:
    group = _Class(tmp_path)
    with group.server:
        models = group.meet()
        group.server.teach(12)
        given = group.server.persistence.models.read_file(group.server.persistence.autosave.save())
        group.give(models, ClassOrder.RESET)
        [link, *_] = group.links
        link.state = {"mode": "stopped", "lessons": 0}
        assert group.give(models, ClassOrder.KEEP)[0]["did"] == "empty"
        for order in (ClassOrder.RESET, ClassOrder.HAND_OVER, ClassOrder.RESET):
            ours, *_ = group.give(models, order)
            assert (ours["did"], ours["model"]) == (order.value, "")
            assert len(group.names()) == 2, "the taught model, and the empty one in use"
        ours, *_ = group.give(models, ClassOrder.LOAD, given, "left turns")
        assert ours["model"] == "" and group.names() == ["R1", "left turns"]
        ours, *_ = group.give(
            models, ClassOrder.RESET
        )  # the news of the lesson is still on its way
        assert ours["model"] == "left turns" and "left turns" in group.names()
        group.undo(models)
        assert group.names() == ["R1", "left turns"]
        for left in (0, 0, 0, 0, 12):
            [back] = group.undo(models)
            assert back["did"] == "undone", back
            assert group.lessons == left
        assert group.names() == ["R1"]


def test_a_robot_that_was_never_taught_saves_nothing_before_a_lesson(tmp_path: Path) -> None:
    group = _Class(tmp_path)
    with group.server:
        models = group.meet()
        given = encode_model(take_model(group.server.rig.loop.history.policy, {"left": 3}))
        [link, *_] = group.links
        link.state = {"mode": "stopped", "lessons": 0}
        group.give(models, ClassOrder.LOAD, given, "left turns")
        assert group.names() == ["left turns"]
        assert group.undo(models)[0]["did"] == "undone"
        assert group.names() == ["R1"], "an empty model is in use again"


def test_later_teaching_survives_an_undo_which_can_be_repeated_for_absent_robots(
    tmp_path: Path,
) -> None:
    group = _Class(tmp_path)
    with group.server:
        models = group.meet()
        group.server.teach(12)
        group.give(models, ClassOrder.RESET)
        group.server.teach(3)
        group.server.fault = "gone"  # type: ignore[attr-defined]
        assert [one["did"] for one in group.undo(models)] == ["away"]
        group.server.fault = "none"  # type: ignore[attr-defined]
        assert [one["did"] for one in group.undo(models)] == ["undone"]
        assert group.lessons == 12 and len(group.names()) == 2


def test_a_robot_that_drives_is_stopped_first_and_one_that_does_not_stop_is_left_alone(
    tmp_path: Path,
) -> None:
    group = _Class(tmp_path)
    with group.server:
        models = group.meet()
        group.server.teach(12)
        [link, *_] = group.links
        link.state, press = {"mode": "train"}, link.stop.press
        link.stop.press = lambda: None  # type: ignore[method-assign]
        outcome, *_ = group.give(models, ClassOrder.RESET)
        assert outcome["did"] == "away" and "did not stop" in outcome["detail"]
        assert group.lessons == 12
        link.stop.press = press  # type: ignore[method-assign]
        group.server.set_mode(Mode.TRAIN)
        outcome, *_ = group.give(models, ClassOrder.RESET)
        assert outcome["did"] == "reset" and group.lessons == 0
        assert group.server.rig.loop.state.emergency, "the teacher releases it"
        link.stop.close()
