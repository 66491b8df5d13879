"""One Gymnasium environment with pictures: opened, stepped and closed on one thread."""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import CameraError, ConfigurationError, need
from robot.types import Game

Pixels = NDArray[np.uint8]
PICTURES = ("auto", "observed", "rendered")


def read_options(text: str) -> dict[str, Any]:
    """Return what `obs_width=160,domain_rand=true` says, for the environment's maker.

    Raises:
        ConfigurationError: If it says nothing of the kind.
    """
    options: dict[str, Any] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals or not name.isidentifier():
            raise ConfigurationError(f"--env-options: {part!r} is not NAME=VALUE")
        try:
            options[name] = json.loads(value)
        except ValueError:
            options[name] = value
    return options


def make(name: str, options: Mapping[str, Any]) -> Any:
    """Return a Gymnasium environment that renders pictures, if it can.

    Args:
        name: `CarRacing-v3`, `module:CarRacing-v3` for one that a module registers, or
            `module:Class` for one that is not registered.
        options: For its maker.

    Raises:
        ConfigurationError: If there is no such environment; says what Gymnasium says.
        MissingExtraError: If Gymnasium is not installed.
    """
    gymnasium = need("gymnasium", "the robot gymnasium", "gymnasium")
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("PYGLET_HEADLESS", "1")  # MiniWorld's library asks for a screen
    module, _, attribute = name.rpartition(":")
    try:
        made = getattr(importlib.import_module(module), attribute, None) if module else None
        if made is not None:
            return made(**{"render_mode": "rgb_array", **options})
        return gymnasium.make(name, **{"render_mode": "rgb_array", **options})
    except Exception as error:  # other people's code: whatever it raises
        raise ConfigurationError(
            f"the environment {name!r} cannot be made: {error}; --env is a name such as "
            "CarRacing-v3, or module:NAME for one that another package brings"
        ) from error


class Environment:
    """An environment as a world to drive in, and the `game` under way. Time passes only by `step`.

    Args:
        name: As for `make`.
        options: As for `make`.
        picture: `observed`, `rendered`, or `auto`: observed if 160x120 or more.
        seed: Of the first game; each further game has the next.
    """

    def __init__(self, name: str, options: Mapping[str, Any], picture: str, seed: int) -> None:
        self.name = name
        self.env = make(name, options)
        self._picture = picture
        self._seed = seed
        self._seen: Any = None
        self.game = Game(number=0, score=0.0, reward=0.0, is_over=False)

    def reset(self) -> None:
        before = self.game.number
        self._seen, _ = self.env.reset(seed=self._seed + before)
        self.game = Game(number=before + 1, score=0.0, reward=0.0, is_over=False)

    def step(self, action: Any) -> None:
        """Act once; after the end of a game this does nothing."""
        if self.game.is_over:
            return
        self._seen, given, is_terminated, is_truncated, _ = self.env.step(action)
        reward = float(np.nan_to_num(given))
        self.game = Game(
            number=self.game.number,
            score=self.game.score + reward,
            reward=reward,
            is_over=bool(is_terminated or is_truncated),
        )

    def picture(self) -> Pixels:
        """Return what there is to see, RGB, shape (height, width, 3).

        Raises:
            CameraError: If the environment gives no picture.
        """
        found = None if self._picture == "rendered" else _picture_in(self._seen)
        is_small = found is None or found.shape[0] < 120 or found.shape[1] < 160
        if is_small and self._picture != "observed":
            rendered = _picture_in(self.env.render())
            found = found if rendered is None else rendered
        if found is None:
            raise CameraError(
                f"the environment {self.name!r} gives no pictures in this way; try another "
                f"--env-picture ({', '.join(PICTURES)})"
            )
        return found

    def close(self) -> None:
        self.env.close()


def _picture_in(seen: Any) -> Pixels | None:
    """Return the picture that an observation is, or that is among its parts."""
    if isinstance(seen, Mapping):
        return next(
            (found for part in seen.values() if (found := _picture_in(part)) is not None), None
        )
    array = np.asarray(seen)
    if array.dtype != np.uint8 or array.ndim not in (2, 3) or min(array.shape[:2]) < 16:
        return None
    if array.ndim == 2:
        array = array[:, :, None]
    if array.shape[2] not in (1, 3):
        return None
    return np.ascontiguousarray(np.broadcast_to(array, (*array.shape[:2], 3)))
