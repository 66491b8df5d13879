"""The options of an import: for example, how much steering counts as a turn, and which move each
name in the data stands for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from robot.errors import ConfigurationError, did_you_mean
from robot.moves import CLASSIC, TURNS_BEYOND
from robot.types import Action

FULL = 1.001
"""Largest accepted share of full lock or full throttle. A share a little above 1 counts as 1: a
stick's -32768 divided by 32767 is -1.00003, and float32 rounds."""
DEFAULT_THRESHOLD = TURNS_BEYOND
"""Steering, as a share of full lock, beyond which a car counts as turning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How to read the data of another program.

    Attributes:
        threshold: Steering, as a share of full lock, beyond which a car turns.
        trim: The steering in the data at which the car drives straight.
        full_lock: The steering in the data at full lock.
        moves: Maps the names of the data's classes to moves.
        columns: Maps meanings to columns of a table: names, or numbers from 1.
        topics: Topics of a ROS bag to read.
    """

    threshold: float = DEFAULT_THRESHOLD
    trim: float = 0.0
    full_lock: float = 1.0
    moves: Mapping[str, Action] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    topics: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Raise ConfigurationError for impossible settings."""
        if not 0.0 <= self.threshold < 1.0:
            raise ConfigurationError(
                f"--threshold must lie between 0 and 1, not {self.threshold:g}"
            )
        if not 0.0 < self.full_lock < float("inf"):
            raise ConfigurationError(
                f"--full-lock must be a finite number above 0, not {self.full_lock:g}"
            )
        if not abs(self.trim) < self.full_lock:
            raise ConfigurationError(
                f"--trim must lie between -{self.full_lock:g} and {self.full_lock:g}, "
                f"not {self.trim:g}"
            )

    def steering(self, written: float) -> float:
        """Convert the data's steering to -1 to 1; raises ValueError if it is beyond full lock.

        The trim becomes 0, and full lock remains -1 and 1, so the values on the two sides of the
        trim are scaled by different factors.
        """
        share, trim = written / self.full_lock, self.trim / self.full_lock
        if not -FULL <= share <= FULL:
            raise ValueError(
                f"steering is {written:g}, which is beyond full lock; give the value of full lock "
                "with --full-lock"
            )
        share = min(max(share, -1.0), 1.0)
        return (share - trim) / (1.0 - trim if share > trim else 1.0 + trim)

    @property
    def turns_beyond(self) -> float:
        """The threshold, rounded up to a float32. Many programs store steering as float32, which
        changes 0.2 to 0.200000003. With a threshold of 0.2, this value is not a turn."""
        return max(self.threshold, float(np.float32(self.threshold)))

    def move(self, name: str) -> Action | None:
        """Return the move that a name in the data stands for: the move that the user assigned to
        it, or else the move with this name. Return None if there is no such move."""
        return self.moves.get(as_word(name)) or _KNOWN.get(as_word(name))


_KNOWN = {str(move): move for move in (*CLASSIC, Action.STOP)}


def as_word(name: str) -> str:
    """Return a class's name without what browsers and exports append: `Spin Left (1)` becomes
    `spin_left`."""
    text = re.sub(r"([ _-]*\(\d+\)|[ _-]samples)+$", "", name.strip().casefold())
    return re.sub(r"[\s_-]+", "_", text).strip("_")


def parse_moves(text: str) -> dict[str, Action]:
    """Read `free=forward,blocked=left`; raises ConfigurationError for any other form."""
    moves = {}
    for pair in filter(None, (part.strip() for part in text.split(","))):
        name, sign, move = (part.strip() for part in pair.partition("="))
        if not sign or not as_word(name):
            raise ConfigurationError(
                f"--moves needs CLASS=MOVE pairs (for example free=forward), not {pair!r}"
            )
        try:
            moves[as_word(name)] = Action(move)
        except ValueError as error:
            hint = did_you_mean(move, map(str, CLASSIC))
            raise ConfigurationError(f"--moves: {error}{hint}") from error
    return moves


def parse_columns(text: str, known: tuple[str, ...]) -> dict[str, str]:
    """Read `picture=1,steering=angle`; raises ConfigurationError for any other form."""
    columns = {}
    for pair in filter(None, (part.strip() for part in text.split(","))):
        role, sign, column = (part.strip() for part in pair.partition("="))
        if not sign or role not in known:
            raise ConfigurationError(
                f"--columns needs MEANING=COLUMN pairs, not {pair!r}; meanings: {', '.join(known)}"
            )
        columns[role] = column
    return columns
