"""A Gymnasium environment of pixels: the task is to move a spot to either end of a line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import gymnasium
import numpy as np


class Line(gymnasium.Env[Any, Any]):
    """The spot begins in the middle; each step costs a point, and an end is worth ten points."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}
    compute: ClassVar[Callable[[], None]] = staticmethod(lambda: None)
    """A function that each step calls, so that a test can let time pass."""

    def __init__(
        self,
        render_mode: str | None = None,
        form: str = "discrete",
        height: int = 40,
        width: int = 21,
    ) -> None:
        self.render_mode = render_mode
        self.form, self.height, self.width = form, height, width
        self.n_steps = 0
        self.observation_space = gymnasium.spaces.Box(0, 255, (height, 4 * width, 3), np.uint8)
        self.action_space: Any = gymnasium.spaces.Discrete(3)
        if form == "box":
            self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        if form == "blind":
            self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32)

    def get_action_meanings(self) -> list[str]:
        return ["NOOP", "TURN_LEFT", "RIGHT"]

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.place = self.width // 2 + int(self.np_random.integers(-2, 3))
        return self._see(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.compute()
        self.n_steps += 1
        self.action = action
        push = float(action[0]) if self.form == "box" else (0, -1, 1)[int(action)]
        self.place = int(np.clip(self.place + np.sign(push), 0, self.width - 1))
        is_over = self.place in (0, self.width - 1)
        return self._see(), 9.0 if is_over else -1.0, is_over, False, {}

    def render(self) -> Any:
        picture = np.full((120, 4 * self.width, 3), 60, np.uint8)
        picture[:, 4 * self.place : 4 * self.place + 4] = 250
        return picture

    def _see(self) -> Any:
        if self.form == "blind":
            return np.array([self.place / self.width], np.float32)
        return np.ascontiguousarray(self.render()[: self.height])
