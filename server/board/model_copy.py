"""Copies a model from one robot to other robots, which check it like any uploaded file."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import suppress
from urllib.parse import quote

from robot.errors import RobotError
from server.board.robot_link import RobotLink
from server.board.transport import HttpAnswer, UnreachableError


async def copy_model(source: RobotLink, targets: Sequence[RobotLink]) -> list[str]:
    """Copy the current model of `source` to all `targets` at the same time. The targets then use
    the model.

    The target robots must be stopped; they save their current models first.

    Returns:
        One sentence for each robot that failed, which also says what did not change.
    """
    try:
        name = name_in(await source.ask("POST", "/api/models/save", {}))
        data = (await source.ask("GET", f"/api/models/{quote(name, safe='')}/file")).body
    except RobotError as error:
        return [f"{source.name} did not send its model: {error}"]
    faults = await asyncio.gather(*(_give(target, name, data) for target in targets))
    return [fault for fault in faults if fault is not None]


async def _give(target: RobotLink, name: str, data: bytes) -> str | None:
    so_far = "did not accept the model, and nothing was changed"
    try:
        kept = name_in(await target.ask("PUT", f"/api/models/{quote(name, safe='')}/file", data))
        so_far = f"stored the model as {kept}, but still uses its previous model"
        await target.ask("POST", f"/api/models/{quote(kept, safe='')}/load", {})
    except RobotError as error:
        return f"{target.name} {so_far}: {error}"
    with suppress(RobotError):
        await target.refresh()
    return None


def name_in(answer: HttpAnswer) -> str:
    """Return the model's name in a robot's answer; UnreachableError if the name is missing."""
    name = answer.json().get("name")
    if not isinstance(name, str):
        raise UnreachableError("the robot's answer is not valid")
    return name
