"""A `drive` message as the control loop takes it: seconds, and the move that a point counts as."""

from __future__ import annotations

from typing import Any

from robot.devices.rig import Rig
from robot.driver import describe, move_at
from robot.types import PilotCommand
from server.protocol import DriveMessage


def command_of(message: DriveMessage, robot: Rig, **known: Any) -> PilotCommand:
    """Return the pilot's command; `known` are its fields that the server knows, not the page."""
    held, point = message.held, message.point
    if point is not None:
        held = move_at(point, describe(robot.loop.state.moves, robot.driver.declared_moves))
    return PilotCommand(
        held=held,
        point=point if held else None,
        frame_id=message.frame,
        seq=message.seq,
        frame_age_s=_seconds(message.frame_age_ms),
        phone_s=_seconds(message.phone_ms),
        **known,
    )


def _seconds(milliseconds: float | None) -> float | None:
    return None if milliseconds is None else milliseconds / 1000
