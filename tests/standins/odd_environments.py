"""Unusual third-party environments: their pictures, actions, rewards and behaviours.

The true picture has three upright bands, red, green and blue, and a white bar at the top; grey
variants have its luminance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces

BANDS = ((250, 0, 0), (0, 250, 0), (0, 0, 250))


def truth(height: int, width: int) -> Any:
    """Return the picture, shape (height, width, 3), uint8."""
    picture = np.zeros((height, width, 3), np.uint8)
    for i, colour in enumerate(BANDS):
        picture[:, i * width // 3 : (i + 1) * width // 3] = colour
    picture[: height // 4] = 250
    return picture


def _grey(picture: Any) -> Any:
    return np.rint(picture @ [0.299, 0.587, 0.114]).astype(np.uint8)


def _box(low: float, high: float, picture: Any) -> spaces.Box:
    return spaces.Box(low, high, picture.shape, picture.dtype)


def _image(picture: Any) -> Any:
    """Return an object with the attributes by which Pillow's images are recognised."""
    return SimpleNamespace(getbands=lambda: ("P",), convert=lambda mode: picture)


def _opaque(picture: Any) -> Any:
    return np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])


_Form = Callable[[Any], tuple[Any, Any]]
"""Converts a picture to another form; also returns its space, or None if no space is declared."""
FORMS: dict[str, _Form] = {
    "bytes": lambda p: (p, _box(0, 255, p)),
    "alpha": lambda p: (_opaque(p), None),
    "alpha, channels first": lambda p: (_opaque(p).transpose(2, 0, 1), None),
    "fractions, no bounds": lambda p: ((f := p / 255), _box(-np.inf, np.inf, f)),
    "fractions said to be bytes": lambda p: ((f := p / 255), _box(0.0, 255.0, f)),
    "around zero": lambda p: ((f := (p / 127.5 - 1).astype(np.float32)), _box(-1.0, 1.0, f)),
    "sixteen bits": lambda p: ((w := p.astype(np.uint16) * 257), _box(0, 65535, w)),
    "frames": lambda p: ([np.zeros_like(p), p], None),
    "grey": lambda p: (_grey(p), None),
    "a stack of grey frames": lambda p: (
        (s := np.stack([_grey(p) // 4, _grey(p) // 3, _grey(p) // 2, _grey(p)])),
        _box(0, 255, s),
    ),
    "an image": lambda p: (_image(p), None),
    "a tuple": lambda p: (
        (np.zeros(3), p),
        spaces.Tuple((spaces.Box(-1.0, 1.0, (3,)), _box(0, 255, p))),
    ),
    "a tuple, no space": lambda p: ((p, np.zeros(3)), None),
    "mask and rgb": lambda p: (
        {"mask": np.full(p.shape[:2], 90, np.uint8), "rgb": p},
        spaces.Dict({"mask": spaces.Box(0, 255, p.shape[:2], np.uint8), "rgb": _box(0, 255, p)}),
    ),
    "nested": lambda p: ({"agent": np.zeros(2), "world": {"pixels": p, "goal": (1, 2)}}, None),
}
"""Ways to deliver a picture."""
NO_PICTURES: dict[str, Any] = {
    "a word": "north",
    "nothing": None,
    "a small board": np.zeros((7, 7, 3), np.uint8),
    "distances": np.full((64, 64), 400.0),
    "a dictionary of numbers": {"speed": 1.0, "place": np.zeros(2)},
}


class _Legacy(spaces.Discrete):
    """A space of numbered actions that only one package uses."""


ACTIONS: dict[str, Callable[[], Any]] = {
    "from minus one": lambda: spaces.Discrete(3, start=-1),
    "a kind of its own": lambda: _Legacy(2),
    "several numbered, two axes": lambda: spaces.MultiDiscrete([[2, 2], [3, 2]]),
    "buttons": lambda: spaces.MultiBinary(4),
    "one number": lambda: spaces.Box(-1.0, 1.0, ()),
    "no bounds": lambda: spaces.Box(-np.inf, np.inf, (2,)),
    "one bound": lambda: spaces.Box(0.0, np.inf, (2,), np.float64),
    "whole numbers": lambda: spaces.Box(-2, 2, (2,), np.int32),
    "a tuple": lambda: spaces.Tuple((spaces.Discrete(2), spaces.Box(0.0, 1.0, (2,)))),
    "nested": lambda: spaces.Dict(
        {"arm": spaces.Dict({"grip": spaces.MultiBinary(1), "at": spaces.Box(-1.0, 1.0, ())})}
    ),
}
UNDRIVABLE: dict[str, tuple[Callable[[], Any], str]] = {
    "one move": (lambda: spaces.Discrete(1), "at least two moves"),
    "a million": (lambda: spaces.Discrete(10**6), "1000000 moves, but a model has at most 32"),
    "words": (lambda: spaces.Text(5), "send only numbers, not a Text"),
    "a picture": (lambda: spaces.Box(0, 255, (64, 64, 3), np.uint8), "12288 numbers"),
    "a hand": (lambda: spaces.Box(-1.0, 1.0, (24,)), "49 moves"),
}
"""Kinds of actions that a pilot cannot give, each with words of its refusal."""
REWARDS: dict[str, tuple[Any, float]] = {
    "a number": (1.5, 1.5),
    "several": (np.array([1.0, -0.25]), 0.75),
    "named": ({"speed": 1.0, "crash": np.float32(-0.5)}, 0.5),
    "nothing": (None, 0.0),
    "not a number": (math.nan, 0.0),
    "infinite": (-math.inf, -1e12),
    "a word": ("great", 0.0),
}
"""Rewards, and their values."""
BEHAVIOURS = ("new", "no seed", "no render mode", "old", "old reset", "ends in lists")


class Odd(gymnasium.Env[Any, Any]):
    """A game of three steps."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"]}
    action_space = spaces.Discrete(2)

    def __init__(self, behaviour: str, reward: str, **options: Any) -> None:
        if options and behaviour == "no render mode":
            raise TypeError("__init__() got an unexpected keyword argument 'render_mode'")
        self.behaviour, self.reward = behaviour, REWARDS[reward][0]
        self.seen = truth(120, 160)
        self.observation_space = _box(0, 255, self.seen)

    def reset(self, **given: Any) -> Any:
        if self.behaviour in ("no seed", "old", "old reset") and given:
            raise TypeError("reset() got an unexpected keyword argument 'seed'")
        self.n_steps = 0
        return self.seen if self.behaviour.startswith("old") else (self.seen, {})

    def step(self, action: Any) -> Any:
        self.n_steps += 1
        is_over = self.n_steps == 3
        ends: tuple[Any, ...] = (False, is_over)
        if self.behaviour == "ends in lists":
            ends = (np.array([is_over]), np.array([False]))
        elif self.behaviour == "old":
            ends = (is_over,)
        return self.seen, self.reward, *ends, {}
