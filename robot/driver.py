"""The interface of a robot's body: its moves, and methods to move, sense and stop.

A move is a name (`robot.types.Action`). The description of a move for pages, exports and recordings
is declared once, in the driver's code. The six classic moves need only their names.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, ClassVar, Self

from robot.types import DEFAULT_MOVES, Action, Mode, Point, Prediction, Sensors

ACTION_TIMEOUT_S = 0.4
"""Duration of one `send_action`, in seconds. The body stops by itself unless the next call comes
before its end, so motors stop even if Python dies. The gate's timeout, 0.3 s, is shorter."""
_LONGEST_LABEL, _LONGEST_ICON, _LONGEST_MEANING = 24, 16, 200
TURNS_BEYOND = 0.2
"""Most steering of a move or point that counts as driving straight, as a share of full lock."""


@dataclass(frozen=True, slots=True)
class Move:
    """One move of a body.

    Args:
        name: A lower-case word such as `fast` or `left_2`; recordings and models store this name.
        label: The button's text: one text, or texts by language (`en`, `es`, `zh`). If a language
            is missing, the page shows the English text; if `label` is empty, the page makes a text
            from the name.
        icon: The name of a classic move, whose arrow is used, or one or two characters such as
            "⏩". If empty, the arrow of this move's name is used, if there is one.
        does: The body's motion in this move, as a sentence.
        steering: From -1 (full left) to 1 (full right), for bodies that are steered.
        throttle: From -1 (full speed backward) to 1 (full speed ahead). Give both steering and
            throttle, or neither.

    Raises:
        ValueError: If a field is out of range; the message names the field.

    Example:
        >>> drift = Move("drift", icon="↪", does="slides to the left", steering=-0.7, throttle=0.9)
        >>> drift.point
        Point(steering=-0.7, throttle=0.9)
    """

    name: Action
    label: str | Mapping[str, str] = field(default="", hash=False)
    icon: str = ""
    does: str = ""
    steering: float | None = field(default=None, kw_only=True)
    throttle: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", Action(self.name))
        if self.name is Action.STOP:
            raise ValueError("do not list 'stop' as a move: every robot can stop without it")
        if any(not text or len(text) > _LONGEST_LABEL for text in self.labels.values()):
            raise ValueError(f"the label of {self.name!r} must have 1 to {_LONGEST_LABEL} letters")
        if len(self.icon) > _LONGEST_ICON or len(self.does) > _LONGEST_MEANING:
            raise ValueError(f"the icon or the meaning of {self.name!r} is too long")
        if (self.steering is None) != (self.throttle is None):
            raise ValueError(f"{self.name!r} needs both steering and throttle, or neither")
        for number in (self.steering, self.throttle):
            if number is not None and not (math.isfinite(number) and -1.0 <= number <= 1.0):
                raise ValueError(f"steering and throttle of {self.name!r} must lie in [-1, 1]")

    @property
    def labels(self) -> dict[str, str]:
        """The label by language. English is included, unless `label` is empty because the page has
        its own labels."""
        if isinstance(self.label, str):
            return {"en": self.label} if self.label else {}
        return dict(self.label)

    @property
    def point(self) -> Point | None:
        """Steering and throttle; None if the move does not define them."""
        if self.steering is None or self.throttle is None:
            return None
        return Point(self.steering, self.throttle)

    def describe(self) -> dict[str, Any]:
        """Return plain values, for a page or a file."""
        return {**asdict(self), "name": str(self.name), "label": self.labels}


CLASSIC: dict[Action, Move] = {
    move.name: move
    for move in (
        Move(Action.FORWARD, does="drives straight ahead", steering=0.0, throttle=0.5),
        Move(Action.LEFT, does="turns left about its left wheel", steering=-1.0, throttle=0.5),
        Move(Action.RIGHT, does="turns right about its right wheel", steering=1.0, throttle=0.5),
        Move(Action.BACKWARD, does="drives straight back", steering=0.0, throttle=-0.5),
        Move(Action.SPIN_LEFT, does="spins left on the spot", steering=-1.0, throttle=0.0),
        Move(Action.SPIN_RIGHT, does="spins right on the spot", steering=1.0, throttle=0.0),
    )
}
"""The moves of a body with two wheels. The page has labels and arrows for these moves."""


def names(moves: Iterable[Move]) -> tuple[Action, ...]:
    """Return the names of these moves, in order."""
    return tuple(move.name for move in moves)


def describe(wanted: Iterable[Action], declared: Iterable[Move] = ()) -> tuple[Move, ...]:
    """Return the wanted moves. A move that is not declared is the classic move of this name, or a
    move that has only the name."""
    known = {**CLASSIC, **{move.name: move for move in declared}}
    return tuple(known.get(name) or Move(name) for name in wanted)


def point_of(name: Action, declared: Iterable[Move] = ()) -> Point | None:
    """Return the steering and throttle of a move or STOP; None if they are not declared."""
    if name is Action.STOP:
        return Point(0.0, 0.0)
    known = next((move for move in declared if move.name == name), CLASSIC.get(name))
    return None if known is None else known.point


def side_of(steering: float, threshold: float = TURNS_BEYOND) -> int:
    """Return the side that this steering turns to: -1 left, 1 right, 0 straight."""
    return (steering > threshold) - (steering < -threshold)


def move_at(point: Point, moves: Iterable[Move], threshold: float = TURNS_BEYOND) -> Action | None:
    """Return the move that a point counts as. Return None if the point is a stop, or if no move
    drives in the point's direction (ahead, back, or on the spot).

    Return the nearest move that drives in the same direction and turns to the same side. If no move
    turns to that side, return the nearest move in the same direction: a curve backward counts as
    backward.

    Raises:
        ValueError: If steering or throttle is not a number in [-1, 1].
    """
    if not all(-1.0 <= number <= 1.0 for number in point):
        raise ValueError(f"steering and throttle must lie in [-1, 1], not {tuple(point)}")
    side, way = side_of(point.steering, threshold), side_of(point.throttle, 0.0)
    known = [(move.name, at) for move in moves if (at := move.point) is not None]
    ahead = [(name, at) for name, at in known if side_of(at.throttle, 0.0) == way]
    near = [(name, at) for name, at in ahead if side_of(at.steering) == side]
    choice = near or (ahead if way else [])
    return min(choice, key=lambda move: math.dist(move[1], point))[0] if choice else None


class Correction:
    """A correction of the orders to a body. The base class changes nothing. An extension may set
    another correction for a body that is built or wired differently from what its driver
    expects."""

    @property
    def signs(self) -> tuple[float, float]:
        """Factors for the values of the left and the right motor."""
        return 1.0, 1.0

    def drive(
        self, body: Driver, action: Action, point: Point | None, *, speed_scale: float
    ) -> Action:
        """Send the point, if one is given and the body accepts points, or else the move; return
        the uncorrected move."""
        if point is not None and body.takes_points:
            return body.send_point(point, speed_scale=speed_scale)
        return body.send_action(action, speed_scale=speed_scale)

    def motors(self, values: tuple[float, float]) -> tuple[float, float]:
        """Return the values for the left and the right motor."""
        return values

    def wheels(self, turned: tuple[float, float]) -> tuple[float, float]:
        """Return how far the robot's left and right wheel turned, from the motors' counts."""
        return turned


class BodyButton(StrEnum):
    """The request that a button on the body makes."""

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
    """True if the driver sets each motor and applies `correction.motors`. If False, another program
    gets the driver's moves or points, sets the motors and has to reverse them."""
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
            """The device that a search found, such as `'Anna' (00:16:53:00:00:01)`, else empty."""
    else:
        device = ""  # not a property: a plugin may set an attribute of this name

    @property
    def moves(self) -> tuple[Action, ...]:
        """Names of this body's moves, without STOP, in the order of `declared_moves`."""
        return names(self.declared_moves)

    @property
    def first_moves(self) -> tuple[Action, ...]:
        """Default moves of a new model: the paper's three moves, or all moves if the body lacks one
        of the three."""
        return DEFAULT_MOVES if set(DEFAULT_MOVES) <= set(self.moves) else self.moves

    @property
    def takes_advice(self) -> bool:
        """True for a body that gets the learner's predictions, even while the pilot drives."""
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
        """Drive for at most `ACTION_TIMEOUT_S`; return the move that the point counts as.

        The point of a declared move drives like this move; a point between two moves drives in
        between. A body that does not accept points drives the move.

        Args:
            point: Steering and throttle.
            speed_scale: As for `send_action`; it does not change the curve.

        Raises:
            ValueError: If a number is out of range.
            Exception: As `send_action`.
        """
        return self.send_action(self.move_of(point), speed_scale=speed_scale)

    def drive(
        self, action: Action, point: Point | None = None, *, speed_scale: float = 1.0
    ) -> Action:
        """Drive the point, if one is given and this body accepts points, or else the move.

        The loop calls this method. The method corrects the order, but not the returned move. Raises
        the errors of `send_action`.
        """
        return self.correction.drive(self, action, point, speed_scale=speed_scale)

    def correct(self, correction: Correction) -> None:
        """Apply a correction from now on. The caller first stops the body and checks that the
        correction suits it."""
        self.correction = correction

    def move_of(self, point: Point) -> Action:
        """Return the move of this body that a point counts as (`move_at`), or STOP."""
        return move_at(point, self.declared_moves) or Action.STOP

    @abstractmethod
    def sense(self) -> Sensors:
        """Read the sensors. Never blocks for longer than a few milliseconds unless `is_remote`."""

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
        """Return the request of a button that was pressed since the last call, else None. Most
        bodies have no buttons."""
        return None

    def advise(self, prediction: Prediction) -> None:  # noqa: B027
        """Receive the learner's prediction on the newest frame; must return immediately and not
        raise."""

    def announce(self, address: str) -> None:  # noqa: B027 - a body without a screen says nothing
        """Receive the page's address, for bodies that can show an address; called before
        `connect`."""

    def show(self, mode: Mode) -> None:  # noqa: B027
        """Show the mode on the body's own screen and lights, if it has any. Never raises."""

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *error: object) -> None:
        self.disconnect()
