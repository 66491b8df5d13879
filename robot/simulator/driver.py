"""The driver of the simulated robot."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, ClassVar

from robot.devices.options import Options, option
from robot.driver import ACTION_TIMEOUT_S, Driver, Sensors
from robot.errors import ConfigurationError, NotConnectedError, did_you_mean
from robot.moves import CLASSIC
from robot.simulator.body import WHEELS_MPS
from robot.simulator.simulation import Simulation
from robot.simulator.world import World, load_world, tinted, world_names
from robot.types import Action, Point


@dataclass(frozen=True, slots=True, kw_only=True)
class SimOptions(Options):
    """Options of the simulated robot."""

    world: str = option("box", "a world's name, or the path of a TOML file")
    seed: int = option(1, "seed of the start, the floor and the noise", range=(0, 2**32 - 1))
    hue: int = option(
        -1,
        "hue of the walls, in degrees of the colour wheel; -1 keeps the world's colours",
        range=(-1, 359),
    )


class SimDriver(Driver):
    """Drives a `Simulation`, whose time passes when the simulated camera's thread or an experiment
    calls `advance`.

    Attributes:
        worlds: The worlds to which the robot can be moved; maps their names to arguments of
            `load_world`.
    """

    name: ClassVar[str] = "sim"
    default_camera: ClassVar[str] = "sim"
    options_type: ClassVar[type[Any]] = SimOptions

    declared_moves = tuple(CLASSIC.values())
    takes_points = True

    def __init__(self, options: SimOptions) -> None:
        self._options = options
        first = self._load(options.world)
        self.worlds = {**{name: name for name in world_names()}, first.name: options.world}
        self.simulation = Simulation(first, options.seed)
        self._sensed = self.simulation.sensors.read()
        self._lock = threading.RLock()
        self._left_s = 0.0
        self._is_connected = False

    def enter(self, name: str) -> None:
        """Move the robot to the start of one of its `worlds`. Stop the robot before this call.
        Raises ConfigurationError if there is no world with this name."""
        if name not in self.worlds:
            known = sorted(self.worlds)
            raise ConfigurationError(
                f"unknown world {name!r}{did_you_mean(name, known)}; choose one of: "
                f"{', '.join(known)}"
            )
        world = self._load(self.worlds[name])
        with self._lock:
            self.simulation.first_world = world

    def _load(self, name: str) -> World:
        world = load_world(name)
        return world if self._options.hue < 0 else tinted(world, self._options.hue)

    @property
    def is_connected(self) -> bool:
        return self._is_connected

    def connect(self) -> None:
        self._is_connected = True

    def disconnect(self) -> None:
        self.stop()
        self._is_connected = False

    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        self._drive(action, None, speed_scale)
        return action

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        action = self.move_of(point)
        self._drive(action, None if action is Action.STOP else point, speed_scale)
        return action

    def _drive(self, action: Action, point: Point | None, speed_scale: float) -> None:
        self.check_action(action, speed_scale)
        if point is None and action not in WHEELS_MPS:
            raise ConfigurationError(
                f"the simulator has no wheel speeds for the move {str(action)!r}; add the speeds "
                "of the left and the right wheel in m/s to robot.simulator.body.WHEELS_MPS"
            )
        if not self._is_connected:
            raise NotConnectedError("the robot 'sim' is not connected; call connect() first")
        with self._lock:
            self.simulation.action, self.simulation.point = action, point
            self.simulation.speed_scale = speed_scale
            self._left_s = ACTION_TIMEOUT_S

    def sense(self) -> Sensors:
        """Return the readings at the end of the world's last step; never waits for a step."""
        return self._sensed

    def stop(self) -> None:
        with self._lock:
            self.simulation.action, self.simulation.point = Action.STOP, None

    def advance(self, dt_s: float) -> None:
        """Advance the world by `dt_s` seconds; an action that was not renewed in time ends."""
        with self._lock:
            moving_s = min(dt_s, self._left_s)
            if moving_s > 0:
                self.simulation.step(moving_s)
            self._left_s -= moving_s
            if dt_s > moving_s:
                self.stop()
                self.simulation.step(dt_s - moving_s)
            self._sensed = self.simulation.sensors.read()
