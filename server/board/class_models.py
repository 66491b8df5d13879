"""Gives one order, such as "save the model", to all robots of a school class. An order can be
undone.

All robots get an order at the same time. Before a robot changes to another model, it saves its
current model. A model without examples is deleted instead. The steps of each robot are recorded, so
that even an order that failed halfway can be undone.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Any
from urllib.parse import quote

from robot.clock import Clock
from robot.errors import UNREADABLE, NotFoundError, RobotError
from server.board.model_copy import name_in
from server.board.robot_link import RobotLink
from server.board.stopping import Stopping
from server.board.teacher_session import Status
from server.board.transport import UnreachableError, within

PATIENCE_S = 20.0
"""How long one robot may take to carry out an order, in seconds."""
_STOP_S, _LOOK_S = 3.0, 0.05
_MOST_UNDONE = 10
_LONGEST_NAME = 40
Undo = Callable[[RobotLink], Awaitable[None]]


class ClassOrder(StrEnum):
    """An order to all robots of a class."""

    KEEP = "keep"
    """Save a dated copy of the model in use, and keep using the model."""
    RESET = "reset"
    """Save the model in use, and start an empty one."""
    HAND_OVER = "hand_over"
    """Save the model in use, start an empty one, and sign out the phones of the class, so that
    another class can use the robots."""
    LOAD = "load"
    """Save the model in use, and load a given one."""


@dataclass(slots=True)
class RobotOutcome:
    """The result of an order, or of its undo, at one robot.

    Attributes:
        did: The order's value if the robot carried it out; `undone` if the order was undone;
            `empty` if there was no model to keep; `away` if the robot did not answer; `failed` if
            the order failed.
        model: Name of the model that was saved; empty if no model was saved.
        detail: The failure's cause, in English.
    """

    number: int
    name: str
    did: str
    model: str = ""
    detail: str = ""


@dataclass(slots=True)
class _Done:
    """An order that was given. For each robot, `steps` contains the functions that undo the order;
    they are called from the last to the first."""

    order: ClassOrder
    steps: dict[int, list[Undo]] = field(default_factory=dict)
    outcomes: list[RobotOutcome] = field(default_factory=list)


class ClassModels:
    """Gives orders to all robots of a board.

    Args:
        robots: Returns the robots that are on the board now.
    """

    def __init__(self, robots: Callable[[], Sequence[RobotLink]], clock: Clock) -> None:
        self._robots, self._clock = robots, clock
        self._done: list[_Done] = []
        self._lock = asyncio.Lock()

    def describe(self) -> dict[str, Any]:
        """Return the last order that can be undone, and its result at each robot."""
        last = self._done[-1] if self._done else None
        return {
            "order": last and last.order.value,
            "robots": [asdict(one) for one in last.outcomes] if last else [],
        }

    async def give(self, order: ClassOrder, data: bytes = b"", name: str = "") -> dict[str, Any]:
        """Give an order to all robots; `data` is the model to load, and `name` its name."""
        async with self._lock:
            done = _Done(order)
            each = (
                self._try(robot, done, self._run(order, data, name)) for robot in self._robots()
            )
            done.outcomes = list(await asyncio.gather(*each))
            if any(done.steps.values()):
                self._done = [*self._done, done][-_MOST_UNDONE:]
            return {"order": order.value, "robots": [asdict(one) for one in done.outcomes]}

    async def undo(self) -> dict[str, Any]:
        """Undo the last order. A further call undoes it on robots that did not answer before."""
        async with self._lock:
            if not self._done:
                raise NotFoundError("there is no order that can be undone")
            last = self._done[-1]
            waiting = [robot for robot in self._robots() if last.steps.get(robot.number)]
            tried = [self._try(robot, last, self._undo) for robot in waiting]
            outcomes = list(await asyncio.gather(*tried))
            if not any(last.steps.values()):
                self._done.pop()
            return {"order": "undo", "robots": [asdict(one) for one in outcomes]}

    async def _try(
        self,
        robot: RobotLink,
        done: _Done,
        act: Callable[[RobotLink, _Done], Awaitable[RobotOutcome]],
    ) -> RobotOutcome:
        if robot.status is not Status.THERE:
            return RobotOutcome(robot.number, robot.name, "away", detail=robot.detail)
        try:
            async with within(PATIENCE_S):
                return await act(robot, done)
        except UnreachableError as error:
            return RobotOutcome(robot.number, robot.name, "away", detail=str(error))
        except RobotError as error:
            return RobotOutcome(robot.number, robot.name, "failed", detail=str(error))
        except UNREADABLE as error:
            detail = f"the robot's answer is not valid: {error!r}"[:300]
            return RobotOutcome(robot.number, robot.name, "failed", detail=detail)
        finally:
            with suppress(RobotError, *UNREADABLE):
                async with within():
                    await robot.refresh()

    def _run(
        self, order: ClassOrder, data: bytes, name: str
    ) -> Callable[[RobotLink, _Done], Awaitable[RobotOutcome]]:
        async def act(robot: RobotLink, done: _Done) -> RobotOutcome:
            steps = done.steps.setdefault(robot.number, [])
            if order is ClassOrder.KEEP:
                return await self._keep(robot, steps)
            await self._stop(robot)
            before, is_empty = await _set_aside(robot)
            if order is ClassOrder.LOAD:
                put = await robot.ask("PUT", f"{_model(name)}/file", data)
                new = name_in(put)
                await robot.ask("POST", f"{_model(new)}/load", {})
            else:
                new = name_in(await robot.ask("POST", "/api/models", {}))
            lessons = await _lessons(robot, new)

            async def go_back(robot: RobotLink) -> None:
                again = f"{_model(before)}/load" if before else "/api/models"
                await robot.ask("POST", again, {})
                if await _lessons(robot, new) == lessons:  # nobody has taught the new model
                    await robot.ask("DELETE", _model(new))

            steps.append(go_back)
            if is_empty and before:
                deleted = (await robot.ask("DELETE", _model(before))).json()

                async def restore(robot: RobotLink) -> None:
                    nonlocal before
                    words = {"undo": deleted.get("undo")}
                    before = name_in(await robot.ask("POST", "/api/models/restore", words))

                steps.append(restore)
            if order is ClassOrder.HAND_OVER:
                signed_out = (await robot.ask("DELETE", "/api/class/phones")).json()

                async def sign_in(robot: RobotLink) -> None:
                    await robot.ask("POST", "/api/class/phones", {"undo": signed_out.get("undo")})

                steps.append(sign_in)
            saved = "" if is_empty else before or ""
            return RobotOutcome(robot.number, robot.name, order.value, model=saved)

        return act

    async def _keep(self, robot: RobotLink, steps: list[Undo]) -> RobotOutcome:
        if robot.state.get("lessons") == 0:
            return RobotOutcome(robot.number, robot.name, "empty")
        name = name_in(await robot.ask("POST", "/api/models/save", {}))
        now = datetime.fromtimestamp(self._clock.wall_s())
        wanted = {"name": f"{name[:_LONGEST_NAME]} {now:%Y-%m-%d %H.%M}"}
        copy = name_in(await robot.ask("POST", f"{_model(name)}/copy", wanted))

        async def remove(robot: RobotLink) -> None:
            await robot.ask("DELETE", _model(copy))

        steps.append(remove)
        return RobotOutcome(robot.number, robot.name, ClassOrder.KEEP.value, model=copy)

    async def _undo(self, robot: RobotLink, done: _Done) -> RobotOutcome:
        steps = done.steps[robot.number]
        if done.order is not ClassOrder.KEEP:
            await self._stop(robot)
        while steps:
            await steps[-1](robot)
            steps.pop()
        return RobotOutcome(robot.number, robot.name, "undone")

    async def _stop(self, robot: RobotLink) -> None:
        """Stop a robot, unless it is stopped; only the teacher can release it."""
        if robot.state.get("mode") == "stopped":
            return
        now_s = self._clock.now_s()
        robot.stop.press(now_s)
        until_s = now_s + _STOP_S
        while robot.stop.stage is not Stopping.STOPPED:
            if self._clock.now_s() > until_s:
                raise UnreachableError("the robot did not stop, so nothing was changed")
            await self._clock.pause(_LOOK_S)


def _model(name: str) -> str:
    return f"/api/models/{quote(name, safe='')}"


async def _set_aside(robot: RobotLink) -> tuple[str | None, bool]:
    """Save the model that a robot uses.

    Returns:
        The name of the model (None if the robot uses none), and True if the model is empty and was
        therefore not saved.
    """
    if robot.state.get("lessons") == 0:
        listed = (await robot.ask("GET", "/api/models")).json()
        name = listed.get("current")
        # just after a model was loaded, the state may still describe the previous one
        if not name or not _lessons_in(listed, name):
            return name, True
    return name_in(await robot.ask("POST", "/api/models/save", {})), False


async def _lessons(robot: RobotLink, name: str) -> int | None:
    """Return the number of examples in a robot's model; None if the robot no longer has it."""
    return _lessons_in((await robot.ask("GET", "/api/models")).json(), name)


def _lessons_in(listed: dict[str, Any], name: str) -> int | None:
    for model in listed.get("models", []):
        if isinstance(model, dict) and model.get("name") == name:
            return int(model["lessons"]) if isinstance(model.get("lessons"), int) else None
    return None
