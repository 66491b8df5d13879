"""Environments as other people write them, one for each seed, each with its true content.

`--env tests.standins.odd_environments:Odd --env-options seed=7`. The true picture has three upright
bands, red, green and blue, and a white bar at the top; grey variants have its luminance.
"""

from __future__ import annotations

import enum
import math
import random
from collections.abc import Callable
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces

BANDS = ((250, 0, 0), (0, 250, 0), (0, 0, 250))
_FACTS: dict[str, Any] = {}


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


class _Image:
    """The attributes by which Pillow's images are recognised."""

    def __init__(self, picture: Any) -> None:
        self._picture = picture

    def getbands(self) -> tuple[str, ...]:
        return ("P",)

    def convert(self, mode: str) -> Any:
        return self._picture


_Form = Callable[[Any], tuple[Any, Any]]
"""Converts a picture to another form; also returns its space, or None if no space is declared."""
FORMS: dict[str, _Form] = {
    "bytes": lambda p: (p, _box(0, 255, p)),
    "bytes, no space": lambda p: (p, None),
    "alpha": lambda p: (np.dstack([p, np.full(p.shape[:2], 255, np.uint8)]), None),
    "fractions": lambda p: ((f := (p / 255).astype(np.float32)), _box(0.0, 1.0, f)),
    "fractions, no bounds": lambda p: (
        (f := (p / 255).astype(np.float64)),
        _box(-np.inf, np.inf, f),
    ),
    "fractions said to be bytes": lambda p: (
        (f := (p / 255).astype(np.float32)),
        _box(0.0, 255.0, f),
    ),
    "around zero": lambda p: ((f := (p / 127.5 - 1).astype(np.float32)), _box(-1.0, 1.0, f)),
    "floats to 255": lambda p: ((f := p.astype(np.float32)), _box(0.0, 255.0, f)),
    "floats to 255, no space": lambda p: (p.astype(np.float64), None),
    "whole numbers": lambda p: ((w := p.astype(np.int64)), _box(0, 255, w)),
    "sixteen bits": lambda p: ((w := p.astype(np.uint16) * 257), _box(0, 65535, w)),
    "channels first": lambda p: ((c := p.transpose(2, 0, 1)), _box(0, 255, c)),
    "fractions, channels first": lambda p: (
        (c := (p / 255).astype(np.float32).transpose(2, 0, 1)),
        _box(0.0, 1.0, c),
    ),
    "alpha, channels first": lambda p: (
        np.dstack([p, np.full(p.shape[:2], 255, np.uint8)]).transpose(2, 0, 1),
        None,
    ),
    "a batch of one": lambda p: (p[None], _box(0, 255, p[None])),
    "frames": lambda p: ([np.zeros_like(p), p], None),
    "frames as one array": lambda p: ((s := np.stack([np.zeros_like(p), p])), _box(0, 255, s)),
    "grey": lambda p: (_grey(p), None),
    "grey, three axes": lambda p: ((g := _grey(p)[:, :, None]), _box(0, 255, g)),
    "a stack of grey frames": lambda p: (
        (s := np.stack([_grey(p) // 4, _grey(p) // 3, _grey(p) // 2, _grey(p)])),
        _box(0, 255, s),
    ),
    "lists": lambda p: (p.tolist(), None),
    "an image": lambda p: (_Image(p), None),
    "a tuple": lambda p: (
        (np.zeros(3), p),
        spaces.Tuple((spaces.Box(-1.0, 1.0, (3,)), _box(0, 255, p))),
    ),
    "a tuple, no space": lambda p: ((p, np.zeros(3)), None),
    "mask and rgb": lambda p: (
        {"mask": np.full(p.shape[:2], 90, np.uint8), "rgb": p},
        spaces.Dict({"mask": spaces.Box(0, 255, p.shape[:2], np.uint8), "rgb": _box(0, 255, p)}),
    ),
    "depth and image": lambda p: (
        {"a_depth": np.full((*p.shape[:2], 1), 0.5, np.float32), "image": p},
        None,
    ),
    "nested": lambda p: ({"agent": np.zeros(2), "world": {"pixels": p, "goal": (1, 2)}}, None),
}
"""Ways to deliver a picture."""
NO_PICTURES: dict[str, Any] = {
    "numbers": np.zeros(4, np.float32),
    "a word": "north",
    "nothing": None,
    "a small board": np.zeros((7, 7, 3), np.uint8),
    "one number": 3,
    "distances": np.full((64, 64), 400.0),
    "a dictionary of numbers": {"speed": 1.0, "place": np.zeros(2)},
}


class Way(enum.IntEnum):
    LEFT = 0
    RIGHT = 1
    FORWARD = 2


class _Legacy(spaces.Discrete):
    """A kind of numbered actions that only one package has."""


def _names(kind: str, n: int, start: int) -> Any:
    """Return names of numbered actions, as attributes of an environment."""
    words = ["A", "LEFT", "left!", "<<", "-1", "", "Turn left", "a" * 40, "b" * 40, "a" * 40][:n]
    by_number = {start + i: word for i, word in enumerate(words)}
    return {
        "meanings": {"get_action_meanings": lambda: words},
        "list": {"action_names": words},
        "in its type": {"action_type": type("Type", (), {"actions": by_number})},
        "enumeration": {"actions": Way},
        "members": {"actions": tuple(Way)[:n]},
        "wrong number": {"actions": ["only one"]},
        "raises": {"get_action_meanings": lambda: 1 / 0},
        "none": {},
    }[kind]


ACTIONS: dict[str, Callable[[], Any]] = {
    "numbered": lambda: spaces.Discrete(3),
    "many numbered": lambda: spaces.Discrete(9),
    "from minus one": lambda: spaces.Discrete(3, start=-1),
    "a kind of its own": lambda: _Legacy(2),
    "several numbered": lambda: spaces.MultiDiscrete([3, 2]),
    "several numbered, two axes": lambda: spaces.MultiDiscrete([[2, 2], [3, 2]]),
    "buttons": lambda: spaces.MultiBinary(4),
    "buttons, two axes": lambda: spaces.MultiBinary((2, 2)),
    "one number": lambda: spaces.Box(-1.0, 1.0, ()),
    "one number in a list": lambda: spaces.Box(-2.0, 2.0, (1,)),
    "a square": lambda: spaces.Box(-1.0, 1.0, (2, 2)),
    "no bounds": lambda: spaces.Box(-np.inf, np.inf, (2,)),
    "one bound": lambda: spaces.Box(0.0, np.inf, (2,), np.float64),
    "whole numbers": lambda: spaces.Box(-2, 2, (2,), np.int32),
    "bytes": lambda: spaces.Box(0, 255, (2,), np.uint8),
    "a dictionary": lambda: spaces.Dict(
        {"steer": spaces.Box(-1.0, 1.0, (1,)), "gear": spaces.Discrete(3)}
    ),
    "a tuple": lambda: spaces.Tuple((spaces.Discrete(2), spaces.Box(0.0, 1.0, (2,)))),
    "nested": lambda: spaces.Dict(
        {"arm": spaces.Dict({"grip": spaces.MultiBinary(1), "at": spaces.Box(-1.0, 1.0, ())})}
    ),
}
UNDRIVABLE: dict[str, tuple[Callable[[], Any], str]] = {
    "one move": (lambda: spaces.Discrete(1), "at least two moves"),
    "a thousand": (lambda: spaces.Discrete(1000), "1000 moves, but a model has at most 32"),
    "a million": (lambda: spaces.Discrete(10**6), "1000000 moves"),
    "words": (lambda: spaces.Text(5), "only send numbers, not a Text"),
    "a picture": (lambda: spaces.Box(0, 255, (64, 64, 3), np.uint8), "12288 numbers"),
    "a hand": (lambda: spaces.Box(-1.0, 1.0, (24,)), "49 moves"),
    "none": (lambda: None, "no action space"),
}
"""Actions that a thumb cannot give, each with words of the sentence that refuses it."""
REWARDS: dict[str, tuple[Any, float]] = {
    "a number": (1.5, 1.5),
    "a whole number": (2, 2.0),
    "a list of one": (np.array([1.5]), 1.5),
    "several": (np.array([1.0, -0.25]), 0.75),
    "named": ({"speed": 1.0, "crash": np.float32(-0.5)}, 0.5),
    "nothing": (None, 0.0),
    "not a number": (math.nan, 0.0),
    "infinite": (-math.inf, -1e12),
    "a word": ("great", 0.0),
    "yes": (True, 1.0),
}
"""Rewards, and their values."""
BEHAVIOURS = ("new", "no seed", "old", "old reset", "ends in lists")
SLOW_S = (0.0, 0.0, 0.05, 0.4, 0.7, 1.5, 3.0)


class Odd(gymnasium.Env[Any, Any]):
    """One of them.

    Attributes:
        wanted: Words of the sentence that refuses it; empty if it can be driven.
        colours: Whether its picture has colours.
        size: Height and width of its picture.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"]}
    compute: ClassVar[Callable[[float], None]] = staticmethod(lambda seconds: None)
    """The effect of a step on time."""
    newest: ClassVar[Odd]

    def __init__(self, seed: int = 0, **options: Any) -> None:
        dice = random.Random(seed)
        Odd.newest = self
        self.takes_mode = dice.random() < 0.7
        if options.keys() - {"render_mode"} or (options and not self.takes_mode):
            raise TypeError(
                f"__init__() got an unexpected keyword argument {next(iter(options))!r}"
            )
        self.wanted = ""
        self.acts: list[Any] = []
        self.is_over = True
        self.longest = dice.randint(4, 9)
        self.takes_s = dice.choice(SLOW_S)
        self.behaviour = dice.choice(BEHAVIOURS)
        self.reward_form = dice.choice(list(REWARDS))
        self._choose_pictures(dice)
        self._choose_actions(dice)

    def _choose_pictures(self, dice: random.Random) -> None:
        observed = truth(dice.choice([16, 64, 119, 120, 240]), dice.choice([18, 84, 160, 321]))
        rendered = truth(dice.choice([48, 200]), dice.choice([60, 333]))
        self.observed_form = dice.choice([*FORMS, *FORMS, *NO_PICTURES])
        self.rendered_form = dice.choice([*FORMS, *NO_PICTURES, "raises"])
        space: Any = None
        if self.observed_form in FORMS:
            self.seen, space = FORMS[self.observed_form](observed)
        else:
            self.seen = NO_PICTURES[self.observed_form]
        self.observation_space = space or spaces.Box(-np.inf, np.inf, (4,))
        if self.rendered_form in FORMS:
            self.shown, _ = FORMS[self.rendered_form](rendered)
        else:
            self.shown = NO_PICTURES.get(self.rendered_form)
        is_large = observed.shape[0] >= 120 and observed.shape[1] >= 160
        is_observed, is_rendered = self.observed_form in FORMS, self.rendered_form in FORMS
        form = self.observed_form if is_observed and (is_large or not is_rendered) else ""
        form = form or (self.rendered_form if is_rendered else "")
        self.form = form
        self.has_colours = "grey" not in form
        self.size = (
            observed
            if form == self.observed_form and is_observed and (is_large or not is_rendered)
            else rendered
        ).shape[:2]
        if not form:
            self.wanted = "gives no picture: it observes"

    def _choose_actions(self, dice: random.Random) -> None:
        if dice.random() < 0.1:
            make, self.wanted = UNDRIVABLE[dice.choice(list(UNDRIVABLE))]
            self.action_space = make()
            return
        self.action_form = dice.choice(list(ACTIONS))
        self.action_space = ACTIONS[self.action_form]()
        if isinstance(self.action_space, spaces.Discrete):
            kinds = ("meanings", "list", "in its type", "enumeration", "members")
            self.names = dice.choice([*kinds, "wrong number", "raises", "none"])
            space = self.action_space
            for name, kept in _names(self.names, int(space.n), int(space.start)).items():
                setattr(self, name, kept)

    def reset(self, **given: Any) -> Any:
        if self.behaviour in ("no seed", "old", "old reset") and given:
            raise TypeError("reset() got an unexpected keyword argument 'seed'")
        self.n_steps, self.is_over = 0, False
        return self.seen if self.behaviour.startswith("old") else (self.seen, _FACTS)

    def step(self, action: Any) -> Any:
        assert not self.is_over, "stepped after the end"
        self.compute(self.takes_s)
        self.acts.append(action)
        assert self.action_space.contains(action), f"{action!r} is not in {self.action_space}"
        self.n_steps += 1
        self.is_over = self.n_steps >= self.longest
        ends: tuple[Any, ...] = (False, self.is_over)
        if self.behaviour == "ends in lists":
            ends = (np.array([self.is_over]), np.array([False]))
        elif self.behaviour == "old":
            ends = (self.is_over,)
        return self.seen, REWARDS[self.reward_form][0], *ends, _FACTS

    def render(self) -> Any:
        if self.rendered_form == "raises":
            raise RuntimeError("no screen")
        return self.shown
