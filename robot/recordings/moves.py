"""The declared moves of a body as text, for the metadata of a recording."""

from __future__ import annotations

import json
from collections.abc import Iterable

from robot.errors import told_as
from robot.moves import Move
from robot.types import Action


def to_text(moves: Iterable[Move]) -> str:
    """Write moves as JSON, for the metadata of a recording."""
    return json.dumps([move.describe() for move in moves], ensure_ascii=False)


def from_text(text: str) -> tuple[Move, ...]:
    """Read the text made by `to_text`; an empty text means no moves.

    Raises:
        ValueError: If the text has another form.
    """
    if not text:
        return ()
    errors = KeyError, TypeError, AttributeError, RecursionError
    with told_as(ValueError, "the description of the moves cannot be read", *errors):
        return tuple(
            Move(
                Action(plain["name"]),
                {str(code): str(words) for code, words in plain["label"].items()},
                str(plain["icon"]),
                str(plain["does"]),
                steering=plain["steering"],
                throttle=plain["throttle"],
            )
            for plain in json.loads(text)
        )
