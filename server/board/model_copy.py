"""Take a model from one robot to others: each of them checks it as it does any uploaded file."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

from robot.errors import RobotError
from server.board.robot_link import RobotLink
from server.board.transport import HttpAnswer, UnreachableError


@dataclass(frozen=True, slots=True, kw_only=True)
class Copied:
    """What became of one copy.

    Attributes:
        robot: The number of the robot that was to get it.
        name: Its name there; None if it did not get it.
        is_used: True if that robot uses it now.
        fault: What failed, and what is as it was before.
    """

    robot: int
    name: str | None = None
    is_used: bool = False
    fault: str | None = None


async def copy_model(
    source: RobotLink, targets: Sequence[RobotLink], *, use: bool = True
) -> list[Copied]:
    """Copy the model in use of one robot to others, all at the same time.

    Args:
        source: Whose model in use is saved and taken.
        targets: Who gets it.
        use: Have them load it as well: they save the model that they use, and must be stopped.
    """
    try:
        name = _name_in(await source.ask("POST", "/api/models/save", {}))
        data = (await source.ask("GET", f"/api/models/{quote(name, safe='')}/file")).body
    except (RobotError, TimeoutError) as error:
        fault = f"{source.name} gave no model: {_why(error)}"
        return [Copied(robot=target.number, fault=fault) for target in targets]
    return list(await asyncio.gather(*(_give(target, name, data, use) for target in targets)))


async def _give(target: RobotLink, name: str, data: bytes, use: bool) -> Copied:
    kept, fault = None, None
    try:
        kept = _name_in(await target.ask("PUT", f"/api/models/{quote(name, safe='')}/file", data))
        if use:
            await target.ask("POST", f"/api/models/{quote(kept, safe='')}/load", {})
    except (RobotError, TimeoutError) as error:
        so = (
            f"has it as {kept} and goes on with its own"
            if kept
            else "did not take it, nothing changed"
        )
        fault = f"{target.name} {so}: {_why(error)}"
    return Copied(robot=target.number, name=kept, is_used=use and fault is None, fault=fault)


def _name_in(answer: HttpAnswer) -> str:
    name = answer.json().get("name")
    if not isinstance(name, str):
        raise UnreachableError("its answer makes no sense")
    return name


def _why(error: Exception) -> str:
    return str(error) or "it does not answer in time"
