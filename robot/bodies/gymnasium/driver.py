"""Drives a Gymnasium environment like a robot. The environment must provide pictures, and its
actions are the robot's moves."""

from __future__ import annotations

import contextlib
import threading
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.bodies.gymnasium.actions import is_car_racing, moves_of, steering_of
from robot.bodies.gymnasium.environment import PICTURES, Environment, read_options
from robot.devices.options import Options, option
from robot.devkit.connected_driver import ConnectedDriver
from robot.driver import ACTION_TIMEOUT_S, Sensors
from robot.types import Action, Point

OVER_S = 1.5
"""Time for which the last picture of a game is shown before the next game begins, in seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GymnasiumOptions(Options):
    """The options of the environment."""

    env: str = option("CarRacing-v3", "name of a Gymnasium environment, or module:NAME")
    env_moves: str = option(
        "",
        "the robot's moves, such as 'left=-0.6,0,0; right=0.6,0,0' or 'left=0; right=1' (default: "
        "the environment's own names, or a move for each number)",
    )
    env_options: str = option(
        "", "options of the environment, such as obs_width=160,obs_height=120"
    )
    env_picture: str = option(
        "auto",
        "what the robot sees: observed, rendered, or auto: a large observation, else rendered",
        choices=PICTURES,
    )
    env_steps: int = option(
        0,
        "steps of the environment for each picture; 0 means 5 for CarRacing, and 1 otherwise",
        range=(0, 50),
    )
    env_seed: int = option(1, "seed of the first game", range=(0, 2**31))


class GymnasiumDriver(ConnectedDriver[bool]):
    """Acts in an environment, whose time passes only when the camera or a test calls `advance`.

    Some environments, in particular their renderers, work only on the thread that made them. The
    environment is therefore made on the thread that calls `advance`, `picture` and `close`. No
    other thread may call these methods.
    """

    name: ClassVar[str] = "gymnasium"
    default_camera: ClassVar[str] = "gymnasium"
    options_type: ClassVar[type[Any]] = GymnasiumOptions

    def __init__(self, options: GymnasiumOptions) -> None:
        super().__init__(options)
        with contextlib.closing(self._make()) as environment:
            table = moves_of(options.env, environment.env, options.env_moves)
            self._action_at = steering_of(table, environment.env.action_space)
        self.declared_moves = tuple(table)
        self.takes_points = self._action_at is not None
        self._actions = {move.name: action for move, action in table.items()}
        self._steps = options.env_steps or (5 if is_car_racing(options.env) else 1)
        self._environment: Environment | None = None
        self._lock = threading.Lock()
        self._action: Any = None
        self._left_s = self._over_s = 0.0
        self.acted = threading.Event()
        """Set when the loop has acted on the last picture. The camera waits for this event before
        the environment makes its next step."""

    def _make(self) -> Environment:
        chosen = self.options
        options = read_options(chosen.env_options)
        return Environment(chosen.env, options, chosen.env_picture, chosen.env_seed)

    @property
    def first_moves(self) -> tuple[Action, ...]:
        """Return all moves. In a game with a brake, for example, the pilot must also teach
        braking."""
        return self.moves

    def _open(self) -> bool:
        return True  # nothing to open: the environment is created in its own thread

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        """Apply an action for at most `ACTION_TIMEOUT_S`. An environment has only one speed."""
        exact = None if self._action_at is None or point is None else self._action_at(point)
        with self._lock:
            self._action = self._actions.get(action) if exact is None else exact
            self._left_s = ACTION_TIMEOUT_S
        self.acted.set()

    def sense(self) -> Sensors:
        environment = self._environment
        return Sensors(game=environment.game if environment else None)

    def stop(self) -> None:
        with self._lock:
            self._action = None

    # On the environment's thread ----------------------------------------------------------------

    def advance(self, dt_s: float) -> None:
        """Let time pass. The environment steps only while the robot makes a move."""
        environment = self._opened()
        with self._lock:
            action = self._action if self._left_s > 0.0 else None
            self._left_s -= dt_s
        if environment.game.is_over:
            self._over_s += dt_s
            if self._over_s >= OVER_S:
                environment.reset()
        elif action is not None:
            self._over_s = 0.0
            for _ in range(self._steps):
                environment.step(action)

    def picture(self) -> Any:
        """Return the current picture, shape (height, width, 3), uint8; raises CameraError."""
        return self._opened().picture()

    def close(self) -> None:
        """Close the environment; the next `advance` or `picture` opens it again."""
        environment, self._environment = self._environment, None
        if environment is not None:
            with contextlib.suppress(Exception):  # errors of a closing environment are harmless
                environment.close()

    def _opened(self) -> Environment:
        if self._environment is None:
            self._environment = self._make()
            self._environment.reset()
        return self._environment
