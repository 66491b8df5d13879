"""A Gymnasium environment with pictures: opened, stepped and closed on one thread.

Environments differ not only in their pictures and actions: some accept no seed or no `render_mode`,
some return lists as rewards, and some use the older form of `reset` and `step`.
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import json
import os
import sys
from collections.abc import Mapping
from ctypes.util import find_library
from functools import partial
from typing import Any

import numpy as np

from robot.bodies.gymnasium.pictures import Pixels, describe, picture_in
from robot.driver import Game
from robot.errors import CameraError, ConfigurationError, need, told_as

PICTURES = ("auto", "observed", "rendered")
_LEAST_OBSERVED = (120, 160)
"""Minimum height and width of an observation that is shown, in pixels. If an environment
has smaller observations, the rendering is shown instead."""
_RENDER_MODES = ("rgb_array", "rgb_array_list", None)
"""The render modes to try, in this order; None stands for an environment without a render mode."""
_LARGEST_REWARD = 1e12
"""Largest magnitude of rewards and scores. Larger and infinite values are reduced to it."""


def read_options(text: str) -> dict[str, Any]:
    """Parse options such as `obs_width=160,domain_rand=true` for the environment's constructor;
    raises ConfigurationError if they are not valid."""
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


def render_without_a_screen() -> None:
    """If there is no screen, set environment variables so that libraries draw in memory. Variables
    that the user has set are kept. On macOS and Windows there is always a screen."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        return
    gl = "osmesa" if find_library("OSMesa") and not find_library("EGL") else "egl"
    # read by MuJoCo, dm_control, robosuite and Meta-World
    gl = os.environ.setdefault("MUJOCO_GL", gl)
    if gl in ("egl", "osmesa"):
        os.environ.setdefault("PYOPENGL_PLATFORM", gl)
    os.environ.setdefault("PYGLET_HEADLESS", "1")  # read by MiniWorld
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # read by pygame
    os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ.setdefault("MPLBACKEND", "agg")


def make(name: str, options: Mapping[str, Any]) -> Any:
    """Return a Gymnasium environment, with rendered pictures if possible.

    Args:
        name: `CarRacing-v3`; `module:CarRacing-v3` for an environment that a module registers; or
            `module:Class` for an environment that is not registered.
        options: Arguments for the environment's constructor.

    Raises:
        ConfigurationError: If there is no such environment, or it is not for one player. The error
            contains Gymnasium's message.
        MissingExtraError: If Gymnasium is not installed.
    """
    gymnasium = need("gymnasium", "the robot gymnasium", "gymnasium")
    render_without_a_screen()
    module, _, attribute = name.rpartition(":")
    wrong = f"the environment {name!r} cannot be made"
    do = "give --env a name such as CarRacing-v3, or MODULE:NAME for another package's environment"
    # third-party code may raise anything
    with told_as(ConfigurationError, wrong, Exception, do=do):
        made = getattr(importlib.import_module(module), attribute, None) if module else None
        maker = made or partial(gymnasium.make, name, disable_env_checker=True)
        env = _made(maker, options)
    if not hasattr(getattr(env, "action_space", None), "sample"):
        several = hasattr(env, "possible_agents") or hasattr(env, "agents")
        why = "it is for several agents" if several else "it has no action space"
        raise ConfigurationError(f"the environment {name!r} cannot be driven as one robot: {why}")
    return env


def _made(maker: Any, options: Mapping[str, Any]) -> Any:
    """Return the environment, made with the first render mode that its constructor accepts."""
    modes = (options["render_mode"],) if "render_mode" in options else _RENDER_MODES
    failures: list[Exception] = []
    for mode in modes:
        asked = {} if mode is None else {"render_mode": mode}
        try:
            return maker(**{**asked, **options})
        except Exception as error:  # third-party code may raise anything
            failures.append(error)
    raise failures[0]


class Environment:
    """A Gymnasium environment with its current `game`. Its time passes only in `step`.

    Args:
        picture: `observed`, `rendered`, or `auto`: the observation if it has at least 160x120
            pixels, and else the rendering.
        seed: The first game's seed; each further game gets the next number, if the environment
            accepts seeds.
    """

    def __init__(self, name: str, options: Mapping[str, Any], picture: str, seed: int) -> None:
        self.name = name
        self.env = make(name, options)
        self._picture = picture
        self._seed = seed
        self._takes_seeds = True
        self._seen: Any = None
        self._shown: Pixels | None = None
        self._before_the_end: Pixels | None = None
        self._render_failure = ""
        self.game = Game(number=0, score=0.0, reward=0.0, is_over=False)

    def reset(self) -> None:
        before = self.game.number
        with self._as_camera_error("cannot begin a game"):
            begun = self._begin(self._seed + before)
        has_facts = isinstance(begun, tuple) and len(begun) == 2 and isinstance(begun[1], Mapping)
        self._seen = begun[0] if has_facts else begun
        self.game = Game(number=before + 1, score=0.0, reward=0.0, is_over=False)

    def step(self, action: Any) -> None:
        """Make one step of the game; does nothing after the game's end."""
        if self.game.is_over:
            return
        with self._as_camera_error("failed in a step"):
            outcome = self.env.step(action)
        if not isinstance(outcome, tuple) or len(outcome) not in (4, 5):
            raise CameraError(
                f"the environment {self.name!r} returned {describe(outcome)} from a step, not the "
                "five values of Gymnasium: observation, reward, terminated, truncated, info"
            )
        self._seen, given, *ends, _ = outcome
        reward = reward_in(given)
        score = min(max(self.game.score + reward, -_LARGEST_REWARD), _LARGEST_REWARD)
        is_over = any(bool(np.any(end)) for end in ends)
        self.game = Game(number=self.game.number, score=score, reward=reward, is_over=is_over)

    def picture(self) -> Pixels:
        """Return the current picture, RGB, shape (height, width, 3); raises CameraError if the
        environment returns no picture.

        Some environments, such as ViZDoom, return a black picture at the end of a game. The
        previous picture is then returned instead, so that the pilot does not teach a move for a
        black picture.
        """
        observed = rendered = None
        if self._picture != "rendered":
            observed = picture_in(self._seen, getattr(self.env, "observation_space", None))
        is_small = observed is None or any(np.less(observed.shape[:2], _LEAST_OBSERVED))
        if is_small and self._picture != "observed":
            rendered = self._rendered()
        found = observed if rendered is None else rendered
        if found is None:
            raise CameraError(
                f"the environment {self.name!r} gives no picture: {self._what_came()}"
            )
        if not self.game.is_over:
            self._before_the_end = found.copy()  # the environment may reuse its array
        elif self._before_the_end is not None and not found.any():
            return self._before_the_end
        return found

    def close(self) -> None:
        self.env.close()

    def _begin(self, seed: int) -> Any:
        if self._takes_seeds:
            try:
                return self.env.reset(seed=seed)
            except TypeError as error:
                if "seed" not in str(error):
                    raise
                self._takes_seeds = False
        return self.env.reset()

    def _rendered(self) -> Pixels | None:
        """Return the rendered picture. After a failure, always return None."""
        if self._render_failure:
            return None
        try:
            takes_mode = "mode" in inspect.signature(self.env.unwrapped.render).parameters
            came = self.env.render(mode="rgb_array") if takes_mode else self.env.render()
        except Exception as error:
            # third-party code may raise anything; a library or a screen may be missing
            self._render_failure = f"rendering failed: {str(error)[:200] or repr(error)}"
            return None
        # an empty list means that there is no new frame
        if not (isinstance(came, list) and not came):
            self._shown = picture_in(came)
        if self._shown is None:
            self._render_failure = f"it renders {describe(came)}"
        return self._shown

    def _what_came(self) -> str:
        told = []
        if self._picture != "rendered":
            told.append(f"it observes {describe(self._seen)}")
        if self._picture == "observed":
            told.append("try --env-picture rendered")
        else:
            told.append(self._render_failure)
        return ", and ".join(told)

    def _as_camera_error(self, what: str) -> contextlib.AbstractContextManager[None]:
        """Return a context manager. Any error in its block becomes a CameraError whose message
        contains the environment's name."""
        return told_as(CameraError, f"the environment {self.name!r} {what}", Exception)


def reward_in(given: Any) -> float:
    """Return a reward as one number: the sum of its parts, where NaN and non-numbers count as 0.

    Example:
        >>> reward_in([1.5]), reward_in({"speed": 1, "crash": -2.0}), reward_in(float("nan"))
        (1.5, -1.0, 0.0)
    """
    parts = given.values() if isinstance(given, Mapping) else [given]
    total = 0.0
    for part in parts:
        with contextlib.suppress(TypeError, ValueError, RuntimeError):
            numbers = np.nan_to_num(np.asarray(part, float), posinf=np.inf, neginf=-np.inf)
            total += float(numbers.clip(-_LARGEST_REWARD, _LARGEST_REWARD).sum())
    return min(max(total, -_LARGEST_REWARD), _LARGEST_REWARD)
