"""The data types that every part of the robot shares.

Units and signs: lengths are in metres, times in seconds on a monotonic clock, angles in radians.
Counter-clockwise and forward are positive. The name of a plain number ends in its unit.
"""

from __future__ import annotations

import re
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar, NamedTuple, Self
from weakref import WeakValueDictionary

_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")


class Action(str):
    """A command to the motors, by name. All actions except STOP are moves; a learner learns moves.

    Drivers can declare more moves (`robot.moves`). A name is a lower-case letter, then up to 31
    letters, digits or underscores. There is only one object for each name, even after pickling and
    copying, so `is` and `==` are equivalent.

    Raises:
        ValueError: If the name is not valid.
    """

    __slots__ = ("__weakref__",)
    _interned: ClassVar[WeakValueDictionary[str, Action]] = WeakValueDictionary()
    _interning: ClassVar[threading.Lock] = threading.Lock()

    STOP: ClassVar[Action]
    FORWARD: ClassVar[Action]
    LEFT: ClassVar[Action]
    RIGHT: ClassVar[Action]
    BACKWARD: ClassVar[Action]
    SPIN_LEFT: ClassVar[Action]
    SPIN_RIGHT: ClassVar[Action]

    def __new__(cls, name: str) -> Action:
        """Return the one object of this name."""
        known = cls._interned.get(name)
        if known is not None:
            return known
        if not isinstance(name, str) or _NAME.fullmatch(name) is None:
            raise ValueError(
                f"{name!r} is not a valid name of a move: use a lower-case letter, then up to 31 "
                "lower-case letters, digits or underscores"
            )
        with cls._interning:  # two threads that use a new name must get the same object
            return cls._interned.setdefault(str(name), super().__new__(cls, name))

    def __reduce__(self) -> tuple[type[Action], tuple[str]]:
        return Action, (str(self),)

    @property
    def value(self) -> str:
        """The name as a plain string."""
        return str(self)


Action.STOP = Action("stop")
Action.FORWARD = Action("forward")
Action.LEFT = Action("left")
Action.RIGHT = Action("right")
Action.BACKWARD = Action("backward")
Action.SPIN_LEFT = Action("spin_left")
Action.SPIN_RIGHT = Action("spin_right")

DEFAULT_MOVES: tuple[Action, ...] = (Action.FORWARD, Action.LEFT, Action.RIGHT)
"""The paper's three moves, in the order in which the page and the tables show them."""


class Point(NamedTuple):
    """Steering and throttle, each from -1 to 1: right and ahead are positive.

    A point accompanies a move, for bodies that are steered proportionally (`robot.moves.move_at`).
    """

    steering: float
    throttle: float


class Mode(StrEnum):
    """The mode that the pilot requested. The robot leaves STOPPED only if the pilot requests it."""

    STOPPED = "stopped"
    TRAIN = "train"
    AUTONOMOUS = "autonomous"


class DrivenBy(StrEnum):
    """The source of the current action."""

    NOBODY = "nobody"
    PILOT = "pilot"
    ROBOT = "robot"


class StopReason(StrEnum):
    """The reason why the robot stands still although a person might expect it to move."""

    PILOT_ASKED = "pilot_asked"
    PILOT_SILENT = "pilot_silent"
    PILOT_GONE = "pilot_gone"
    FRAME_STALE = "frame_stale"
    LINK_SLOW = "link_slow"
    CAMERA_FAULT = "camera_fault"
    DRIVE_FAULT = "drive_fault"
    LOOP_FAULT = "loop_fault"
    EMERGENCY = "emergency"
    BUTTON = "button"
    NEEDS_HELP = "needs_help"  # the robot could not free itself, and waits for the pilot


class Encoding(StrEnum):
    """The format of a frame's bytes."""

    JPEG = "jpeg"
    YUYV = "yuyv"  # 4:2:2, two bytes per pixel, the format of USB cameras
    RGB = "rgb"  # three bytes a pixel, rows from the top


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One upright picture. A JPEG is encoded again only if it had to be turned (`Mounting`).

    `frame_id` counts up from 1 within one run; commands, examples and recordings refer to frames by
    this number. `captured_s` is the clock's time at which the picture was taken.
    """

    frame_id: int
    captured_s: float
    width: int
    height: int
    encoding: Encoding
    data: bytes = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class PilotCommand:
    """One command of the pilot: the move held, and the frame that was on the screen.

    `held` is None while the pilot holds no move; the command is then only a heartbeat. `seq` counts
    up within one connection; `received_s` is the loop's clock at receipt, never the phone's.
    `frame_age_s` is the page's estimate of the frame's age when the command was sent, and `phone_s`
    the part of this age that the frame had spent on the phone. `proven_s` is the earliest time at
    which the command can have been sent; None means the time of receipt. `seen_id` is the newest
    frame that the page has acknowledged; None if unknown. `point` is the exact steering and
    throttle, if `held` was steered proportionally.
    """

    held: Action | None
    frame_id: int | None
    seq: int
    received_s: float
    pilot: str = "pilot"
    frame_age_s: float | None = None
    phone_s: float | None = None
    proven_s: float | None = None
    seen_id: int | None = None
    point: Point | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """The policy's proposal on one frame, and the reasons for it.

    `probabilities` are the smoothed votes per move, which sum to 1; empty before the first example.
    `novelty` is 0 for a familiar view, and 1 or more for a view unlike all examples. `node` is the
    learned image nearest to the view, and `distance` the distance between the two.
    """

    frame_id: int
    action: Action | None = None
    confidence: float = 0.0
    probabilities: Mapping[Action, float] = field(default_factory=dict)
    node: int | None = None
    distance: float = 0.0
    novelty: float = 0.0
    is_stalled: bool = False
    """True while the picture or a bumper shows that the robot does not move although it should."""
    is_turn: bool = False
    """True if the action is known to steer to one side."""
    needs_help: bool = False
    """True if the robot could not free itself, so it stands still and waits for the pilot."""
    point: Point | None = None
    """The steering and throttle of `action`, if the pilot steered proportionally."""
    spread: float | None = None
    """Standard deviation of the steering of `point`."""

    @property
    def is_novel(self) -> bool:
        """True if the view is unlike all examples."""
        return self.novelty >= 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The gate's decision for one tick: the action, its source, and the reason if it is STOP.

    `point` is the exact steering and throttle, if the pilot or the robot steers proportionally;
    STOP has no point.
    """

    action: Action
    driven_by: DrivenBy
    mode: Mode
    speed_scale: float = 1.0
    stop_reason: StopReason | None = None
    asks_pilot: bool = False
    point: Point | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """One labelled frame that was given to the learner."""

    frame_id: int
    label: Action
    is_intervention: bool
    point: Point | None = None


class StartStop(ABC):
    """Base class of parts that start when a `with` block is entered, and stop when it is left."""

    @abstractmethod
    def start(self) -> None:
        """Start the part; does nothing if the part has already started."""

    @abstractmethod
    def stop(self) -> None:
        """Stop the part and release its resources; does nothing if the part is not running."""

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()
