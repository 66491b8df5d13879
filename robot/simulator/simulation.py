"""A simulated robot in a world: body, camera and noise, advanced by `step`.

The simulation uses no clock and no thread. The simulator's driver and camera run the simulation in
real time; experiments step it as fast as they can. The same world, seed and actions yield the same
numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot.driver import Pose
from robot.simulator.body import WHEELS, WHEELS_MPS, move, push_out
from robot.simulator.renderer import Renderer
from robot.simulator.sensors import SimSensors, bumpers
from robot.simulator.things import move_things
from robot.simulator.world import World
from robot.types import Action, Point

_LONGEST_STEP_S = 0.02
DRIFT_S = 1.0
"""Time constant of the wheels' drift to one side, in seconds."""


_SLIP_SHARE, _PIXEL_NOISE = 0.04, 3.0
"""Standard deviations of the noise: of each wheel's speed, as a share of the speed, and of each
pixel, where 255 is white. The value for the wheels applies to a step of 0.02 s. In shorter steps
the deviation is larger, because otherwise the noise would average out at high frame rates."""


class Simulation:
    """One robot in one world.

    Args:
        world: The world that the robot is in.
        seed: Determines the start pose, the floor pattern and the noise.
        is_noisy: False for a world without noise.

    Attributes:
        drift_share: Standard deviation of a slow drift of the wheels on straight moves, as a share
            of their speed: one wheel turns faster, the other slower. With 0 there is no drift.
        sensors: The robot's sensors.
        contacts_rad: Bearings at which the body touches something, relative to straight ahead.
        action: The current move.
        point: The current steering and throttle; None if the robot is not driven proportionally.
        first_world: The initial state of the world. Any thread may set `first_world` to another
            world. The world changes at the next step, because `world` and the renderer change only
            on the thread that steps and renders.
    """

    def __init__(self, world: World, seed: int = 0, *, is_noisy: bool = True) -> None:
        self.world = self.first_world = self._entered = world
        self.is_noisy = is_noisy
        self._seed = seed
        self._motion_rng, self._pixel_rng, self._drift_rng = (
            np.random.default_rng((seed, stream)) for stream in (0, 2, 4)
        )
        self._drift = 0.0
        self.drift_share = 0.0
        self._renderer: Renderer | None = None
        self._grain: tuple[NDArray[np.int16], NDArray[np.int16]] | None = None
        self.sensors = SimSensors(self, seed)
        self.contacts_rad: list[float] = []
        self.pose = self._start_pose()
        self.action = Action.STOP
        self.point: Point | None = None
        self.speed_scale = 1.0

    def step(self, dt_s: float) -> None:
        """Advance by `dt_s` seconds with the current action."""
        if self.first_world is not self._entered:
            self.close()
            self.restart()
        parts = max(1, math.ceil(dt_s / _LONGEST_STEP_S - 1e-9))
        for _ in range(parts):
            self._step_once(dt_s / parts)

    def restart(self) -> None:
        """Move the robot and all things back to their starts. The random state is not reset, so
        starts vary."""
        first_world = self.first_world
        self.world = first_world
        self.contacts_rad = []
        self.action, self.point = Action.STOP, None
        self.pose = self._start_pose()
        # set after `world`, because another thread reads both in `shown_world`
        self._entered = first_world

    @property
    def shown_world(self) -> World:
        """The world to show: the current world, or one that was chosen but that the simulation has
        not entered yet."""
        chosen = self.first_world
        return self.world if chosen is self._entered else chosen

    @property
    def bumpers(self) -> tuple[bool, bool]:
        """State of the left and the right bumper: True if pressed."""
        return bumpers(self.contacts_rad)

    @property
    def is_pushing(self) -> bool:
        """True while the robot drives forward or in a curve, but is held up by a wall or a
        thing."""
        return sum(self._wheels_mps) > 0.0 and any(self.bumpers)

    @property
    def _wheels_mps(self) -> tuple[float, float]:
        return WHEELS_MPS[self.action] if self.point is None else WHEELS.at(self.point)

    @property
    def is_touching(self) -> bool:
        """True while the body touches a wall or a thing, on any side."""
        return bool(self.contacts_rad)

    def render(self) -> NDArray[np.uint8]:
        """Return the camera's picture, shape (120, 160, 3), RGB."""
        if self._renderer is None:
            self._renderer = Renderer(self.world, self._seed)
        picture = self._renderer.render(self.pose, self.world.obstacles)
        if self.is_noisy:
            picture = self._add_grain(picture)
        return picture

    def render_large(self) -> NDArray[np.uint8]:
        """Return the view of the last `render` at twice the resolution and without noise.

        The view is for people; its shape is (240, 320, 3), RGB. The call does not change the random
        state, nor the results of `render`.
        """
        if self._renderer is None:
            raise RuntimeError("render_large enlarges the last render: call render first")
        return self._renderer.render_large()

    def close(self) -> None:
        """Close the renderer; the next picture opens it again."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _step_once(self, dt_s: float) -> None:
        left_mps, right_mps = self._wheels_mps
        if self.is_noisy and dt_s > 0.0 and (left_mps or right_mps):
            share = _SLIP_SHARE * math.sqrt(_LONGEST_STEP_S / dt_s)
            slips = self._motion_rng.normal(1.0, share, 2).tolist()
            left_mps, right_mps = left_mps * slips[0], right_mps * slips[1]
        is_straight = self.action in (Action.FORWARD, Action.BACKWARD)
        if self.drift_share and (is_straight or self.point is not None):
            self._drift_on(dt_s)
            left_mps, right_mps = left_mps * (1 - self._drift), right_mps * (1 + self._drift)
        scale = self.speed_scale
        moved = move(self.pose, left_mps * scale, right_mps * scale, dt_s)
        self.world = move_things(self.world, moved, dt_s)
        self.pose, self.contacts_rad = push_out(self.world, moved)

    def _drift_on(self, dt_s: float) -> None:
        """Update the drift: an Ornstein-Uhlenbeck process with standard deviation `drift_share`."""
        share = dt_s / DRIFT_S
        step = self._drift_rng.normal(0.0, self.drift_share * math.sqrt(2 * share))
        self._drift += float(step) - share * self._drift

    def _start_pose(self) -> Pose:
        start, world = self.world.start, self.world
        shift = [float(part) for part in self._motion_rng.uniform(-1.0, 1.0, 3)]
        return Pose(
            x_m=start.x_m + world.start_spread_m * shift[0],
            y_m=start.y_m + world.start_spread_m * shift[1],
            heading_rad=start.heading_rad + world.start_spread_rad * shift[2],
        )

    def _add_grain(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        # Shift one block of noise by a random amount for each picture. The shifted block looks as
        # good as 57,600 new random numbers, and is far faster.
        if self._grain is None:
            rng = np.random.default_rng((self._seed, 3))
            parts = (rng.normal(0.0, _PIXEL_NOISE, picture.size).astype(np.int16) for _ in range(4))
            block = np.concatenate(list(parts))
            self._grain = block, np.empty(picture.shape, np.int16)
        block, noisy = self._grain
        start = int(self._pixel_rng.integers(0, 3 * picture.size))
        np.add(picture, block[start : start + picture.size].reshape(picture.shape), out=noisy)
        np.clip(noisy, 0, 255, out=noisy)
        return noisy.astype(np.uint8)
