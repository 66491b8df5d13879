"""What a person says of data that are imported: what counts as a turn, and what names mean."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from robot.driver import CLASSIC, TURNS_BEYOND
from robot.errors import ConfigurationError, did_you_mean
from robot.types import Action

DEFAULT_THRESHOLD = TURNS_BEYOND
"""Share of full lock from which on a car is said to turn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How data of other programs are to be understood.

    Attributes:
        threshold: Share of full lock beyond which a car turns.
        trim: Steering, as it is written, at which the car drives straight on.
        full_lock: Steering, as it is written, at full lock.
        moves: Which move a class of the data is, by the class's name.
        columns: Which column of a table has what, by its name or its number, from 1.
        topics: Which topics of a ROS bag to take.
    """

    threshold: float = DEFAULT_THRESHOLD
    trim: float = 0.0
    full_lock: float = 1.0
    moves: Mapping[str, Action] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    topics: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse by a ConfigurationError what no data can be read by."""
        if not 0.0 <= self.threshold < 1.0:
            raise ConfigurationError(
                f"--threshold must lie between 0 and 1, not {self.threshold:g}"
            )
        if not 0.0 < self.full_lock < float("inf"):
            raise ConfigurationError(f"--full-lock must be above 0, not {self.full_lock:g}")
        if not abs(self.trim) < self.full_lock:
            raise ConfigurationError(
                f"--trim must lie between -{self.full_lock:g} and {self.full_lock:g}, "
                f"not {self.trim:g}"
            )

    def steering(self, written: float) -> float:
        """Return steering from -1 to 1 of what is written; ValueError if it is beyond full lock.

        Straight on is 0 and full lock stays full lock, so a trim stretches one side.
        """
        share, trim = written / self.full_lock, self.trim / self.full_lock
        if not -1.0 <= share <= 1.0:
            raise ValueError(
                f"steering is {written:g}, beyond full lock; --full-lock says how much that is"
            )
        return (share - trim) / (1.0 - trim if share > trim else 1.0 + trim)

    def move(self, name: str) -> Action | None:
        """Return the move that a class is: as a person said, or as it is called; else None."""
        return self.moves.get(as_word(name)) or _KNOWN.get(as_word(name))


_KNOWN = {str(move): move for move in (*CLASSIC, Action.STOP)}


def as_word(name: str) -> str:
    """Return a class's name without what browsers and exports add: `Spin Left (1)` is
    `spin_left`."""
    text = re.sub(r"([ _-]*\(\d+\)|[ _-]samples)+$", "", name.strip().casefold())
    return re.sub(r"[\s_-]+", "_", text).strip("_")


def parse_moves(text: str) -> dict[str, Action]:
    """Read `free=forward,blocked=left`; ConfigurationError if it is anything else."""
    moves = {}
    for pair in filter(None, (part.strip() for part in text.split(","))):
        name, sign, move = (part.strip() for part in pair.partition("="))
        if not sign or not as_word(name):
            raise ConfigurationError(f"--moves takes CLASS=MOVE, as free=forward, not {pair!r}")
        try:
            moves[as_word(name)] = Action(move)
        except ValueError as error:
            hint = did_you_mean(move, map(str, CLASSIC))
            raise ConfigurationError(f"--moves: {error}{hint}") from error
    return moves


def parse_columns(text: str, known: tuple[str, ...]) -> dict[str, str]:
    """Read `picture=1,steering=angle`; ConfigurationError if it is anything else."""
    columns = {}
    for pair in filter(None, (part.strip() for part in text.split(","))):
        role, sign, column = (part.strip() for part in pair.partition("="))
        if not sign or role not in known:
            raise ConfigurationError(
                f"--columns takes MEANING=COLUMN, not {pair!r}; meanings: {', '.join(known)}"
            )
        columns[role] = column
    return columns
