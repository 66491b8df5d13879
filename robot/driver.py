"""The interface of a robot's body: it moves (`robot.moves`), senses (`Sensors`) and stops."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Self

from robot.moves import Move, describe, move_at
from robot.types import DEFAULT_MOVES, Action, Mode, Point, Prediction

ACTION_TIMEOUT_S = 0.4
"""Duration of one `send_action`, in seconds. The body ends each move by itself after this time, so
motors stop even if Python dies. If the pilot is silent, the gate stops the robot after 0.3 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """The robot's position and heading, in metres and radians.

    In a virtual world the pose is exact, in the world's coordinates. For a real robot the pose is
    an estimate from the wheels, relative to the pose at the time of connecting. This estimate
    drifts.
    """

    x_m: float
    y_m: float
    heading_rad: float
    is_estimate: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Game:
    """State of a game that is played by driving: its number, the score, the last reward."""

    number: int
    score: float
    reward: float
    is_over: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Readings of all sensors except the camera. A reading is None if its sensor is missing. NaN
    and infinity become None, because some drivers report infinity for "out of range"."""

    distance_m: float | None = None
    bumped: bool | None = None
    bumpers: tuple[bool, ...] = ()
    """State of each bumper, from left to right; `bumped` is true if any bumper is pressed."""
    battery_share: float | None = None
    pose: Pose | None = None
    game: Game | None = None

    def __post_init__(self) -> None:
        """Convert readings to Python's own types, for JSON. Refuse readings of a wrong type."""
        pose, game, change = self.pose, self.game, object.__setattr__
        for name in ("distance_m", "battery_share"):
            if (number := getattr(self, name)) is not None:
                change(self, name, float(number) if math.isfinite(number) else None)
        for name in ("x_m", "y_m", "heading_rad") if pose is not None else ():
            change(pose, name, number := float(getattr(pose, name)))
            if not math.isfinite(number):
                change(self, "pose", None)
        change(self, "bumped", None if self.bumped is None else bool(self.bumped))
        change(self, "bumpers", tuple(map(bool, self.bumpers)))
        if game is not None and not isinstance(game, Game):
            raise TypeError(f"Sensors.game must be a Game, not {game!r}")


class Correction:
    """A correction of the orders to a body. The base class changes nothing. An extension may set
    another correction for a body that is built or wired differently from what its driver
    expects."""

    @property
    def signs(self) -> tuple[float, float]:
        """Factors by which the values of the left and the right motor are multiplied."""
        return 1.0, 1.0

    def drive(
        self, body: Driver, action: Action, point: Point | None, *, speed_scale: float
    ) -> Action:
        """Send steering and throttle if the body accepts them, otherwise the move. Return the move
        before any correction."""
        if point is not None and body.takes_points:
            return body.send_point(point, speed_scale=speed_scale)
        return body.send_action(action, speed_scale=speed_scale)

    def motors(self, values: tuple[float, float]) -> tuple[float, float]:
        """Return the corrected values of the left and the right motor."""
        return values

    def wheels(self, turned: tuple[float, float]) -> tuple[float, float]:
        """Return how far the robot's left and right wheel turned, given the motors' counts."""
        return turned


class BodyButton(StrEnum):
    """What a person requests with a button on the body."""

    STOP = "stop"
    START = "start"  # start in the mode that was used last


class Driver(ABC):
    """A body: its motors, and its sensors except the camera. A body is found by name among the
    entry points.

    A driver declares its options as a frozen dataclass in its code. Each field has a default and
    `metadata={"help": ...}`, and becomes a flag of the command line. The driver declares its moves
    in `declared_moves`.
    `connect`, `stop` and `disconnect` are idempotent; `stop` and `disconnect` are safe on a
    half-built driver. All methods except `__init__` may be called on any thread, but only one
    method at a time. `drivelesson new-driver NAME` writes a first version; `robot.testing` tests
    it.

    Example:
        >>> from robot.testing import FakeDriver
        >>> with FakeDriver() as body:
        ...     body.send_action(Action.FORWARD, speed_scale=0.5)
        'forward'
        >>> body.now
        'stop'
    """

    name: ClassVar[str]
    default_camera: ClassVar[str]
    options_type: ClassVar[type[Any]]
    declared_moves: tuple[Move, ...] = describe(DEFAULT_MOVES)
    takes_points: bool = False
    """True for a body that accepts proportional steering: see `send_point`."""
    turns_motors: ClassVar[bool] = False
    """True if the driver sets each motor and applies `correction.motors`. Otherwise another program
    sets the motors, and must reverse those that turn the wrong way."""
    correction: Correction = Correction()
    """The differences between this body and what its driver expects; set by `correct`."""
    is_remote: ClassVar[bool] = False
    """True for a body that answers over a network: `send_action`, `sense`, `stop`, `take_button`
    and `show` may then block for up to half a second, and are called on a separate thread."""

    @abstractmethod
    def __init__(self, options: Any) -> None: ...

    if TYPE_CHECKING:

        @property
        def device(self) -> str:
            """The device that a search found, such as `'Anna' (00:16:53:00:00:01)`, or empty."""
    else:
        device = ""  # not a property: a plugin may set an attribute of this name

    @property
    def moves(self) -> tuple[Action, ...]:
        """The names of `declared_moves`, in that order; STOP is not among them."""
        return tuple(move.name for move in self.declared_moves)

    @property
    def first_moves(self) -> tuple[Action, ...]:
        """Default moves of a new model: the paper's three moves, or all moves if the body lacks one
        of the three."""
        return DEFAULT_MOVES if set(DEFAULT_MOVES) <= set(self.moves) else self.moves

    @property
    def takes_advice(self) -> bool:
        """True if `advise` gets each prediction, even while the pilot drives."""
        return False

    @property
    @abstractmethod
    def is_connected(self) -> bool:
        """True between a successful `connect` and `disconnect`."""

    @abstractmethod
    def connect(self) -> None:
        """Open the hardware.

        Raises:
            DriveError: If a motor or a required sensor is missing; the message names the port.
            MissingExtraError: If a library is not installed.
        """

    @abstractmethod
    def disconnect(self) -> None:
        """Stop the motors and release the hardware."""

    @abstractmethod
    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        """Move for at most `ACTION_TIMEOUT_S`, and return the action that was sent.

        Args:
            action: STOP, or one of `moves`.
            speed_scale: Share of the driver's full speed, in (0, 1].

        Raises:
            NotConnectedError: Before `connect`.
            DriveError: If the hardware fails; the caller must assume that the robot may be moving.
            ValueError: If the action is not one of `moves`, or the scale is out of range.
        """

    def send_point(self, point: Point, *, speed_scale: float = 1.0) -> Action:
        """Steer proportionally for at most `ACTION_TIMEOUT_S`; return the nearest move.

        The steering and throttle that a move declares have the same effect as this move. Values
        between those of two moves cause a motion between the two. A body that accepts no points
        drives the returned move.

        Args:
            point: Steering and throttle.
            speed_scale: Share of the driver's full speed, in (0, 1]; the curve keeps its radius.

        Raises:
            ValueError: If a number is out of range.
            Exception: Any error of `send_action`.
        """
        return self.send_action(self.move_of(point), speed_scale=speed_scale)

    def drive(
        self, action: Action, point: Point | None = None, *, speed_scale: float = 1.0
    ) -> Action:
        """Send steering and throttle if this body accepts them, otherwise the move.

        The loop calls this method. The method applies `correction` to the order, but not to the
        returned move. Raises the errors of `send_action`.
        """
        return self.correction.drive(self, action, point, speed_scale=speed_scale)

    def correct(self, correction: Correction) -> None:
        """Apply a correction from now on. The caller first stops the body and checks that the
        correction suits it."""
        self.correction = correction

    def move_of(self, point: Point) -> Action:
        """Return the declared move nearest to a point (`move_at`), or STOP if there is none."""
        return move_at(point, self.declared_moves) or Action.STOP

    @abstractmethod
    def sense(self) -> Sensors:
        """Read the sensors. Blocks for at most a few milliseconds, unless the body `is_remote`."""

    @abstractmethod
    def stop(self) -> None:
        """Stop the motors now. Never raises on a driver that is not connected."""

    def check_action(self, action: Action, speed_scale: float) -> None:
        """Raise ValueError if the body does not have this move, or the scale is out of range."""
        if action is not Action.STOP and action not in self.moves:
            known = ", ".join(self.moves)
            raise ValueError(f"the robot {self.name!r} has no move {action!r}; it has: {known}")
        if not 0.0 < speed_scale <= 1.0:
            raise ValueError(f"speed_scale must lie in (0, 1], not {speed_scale}")

    def take_button(self) -> BodyButton | None:
        """Return the request of a button that was pressed since the last call, or None. Most bodies
        have no buttons."""
        return None

    def advise(self, prediction: Prediction) -> None:  # noqa: B027
        """Receive the learner's prediction on the newest frame; must return at once, not raise."""

    def announce(self, address: str) -> None:  # noqa: B027 - a body without a screen does nothing
        """Receive the page's address, for bodies that can show an address; called before
        `connect`."""

    def show(self, mode: Mode) -> None:  # noqa: B027
        """Show the mode on the body's own screen and lights, if it has any. Never raises."""

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *error: object) -> None:
        self.disconnect()
