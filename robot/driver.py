"""What a robot's body can do: move, sense, and stop by itself when commands cease."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import StrEnum
from types import TracebackType
from typing import Any, ClassVar, Self

from robot.moves import Move, describe, names
from robot.types import DEFAULT_MOVES, Action, Mode, Prediction, Sensors

ACTION_TIMEOUT_S = 0.4
"""How long one `send_action` lasts. The body stops by itself unless the next comes before:
just above the gate's watchdog of 0.3 s, so that motors stop even if Python dies."""


class BodyButton(StrEnum):
    """What a button on the body asks for."""

    STOP = "stop"
    START = "start"  # in the last mode


class Driver(ABC):
    """A body: motors and the sensors beside them. Found by name among the entry points.

    A driver declares its options as a frozen dataclass beside its code; each field has a
    default and `metadata={"help": ...}`, and becomes a flag of the command line. It declares its
    moves in `declared_moves`.
    `connect`, `stop` and `disconnect` are idempotent, and the last two are safe on a
    half-built driver. All methods but `__init__` may be called from any one thread at a time.
    """

    name: ClassVar[str]
    default_camera: ClassVar[str]
    options_type: ClassVar[type[Any]]
    declared_moves: tuple[Move, ...] = describe(DEFAULT_MOVES)
    track_m: float | None = None
    """Distance between two wheels that steer by their difference, for an estimate of where the
    robot is; None: it is not built so, or nobody measured it."""
    is_remote: ClassVar[bool] = False
    """True for a body that answers over a network: `send_action`, `sense`, `stop`, `take_button`
    and `show` may then block for up to half a second, and are called on a thread of their own."""

    @abstractmethod
    def __init__(self, options: Any) -> None: ...

    @property
    def moves(self) -> tuple[Action, ...]:
        """Names of what this body can do besides standing, in the order of `declared_moves`."""
        return names(self.declared_moves)

    @property
    def first_moves(self) -> tuple[Action, ...]:
        """What a new model learns unless a person chooses: the paper's three, or else all."""
        return DEFAULT_MOVES if set(DEFAULT_MOVES) <= set(self.moves) else self.moves

    @property
    def takes_advice(self) -> bool:
        """True for a body that passes on what the learner would do, whoever drives."""
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
        """Stop the motors and let go of the hardware."""

    @abstractmethod
    def send_action(self, action: Action, *, speed_scale: float = 1.0) -> Action:
        """Move so for at most `ACTION_TIMEOUT_S`, and return the action really sent.

        Args:
            action: STOP, or one of `moves`.
            speed_scale: Share of the driver's full speed, in (0, 1].

        Raises:
            NotConnectedError: Before `connect`.
            DriveError: If the hardware refuses; the caller must assume that it may be moving.
            ValueError: If the action is not one of `moves`, or the scale is out of range.
        """

    @abstractmethod
    def sense(self) -> Sensors:
        """Read the sensors. Never blocks for longer than a few milliseconds unless `is_remote`."""

    @abstractmethod
    def stop(self) -> None:
        """Stop the motors now. Never raises on a driver that is not connected."""

    def check_action(self, action: Action, speed_scale: float) -> None:
        """Raise ValueError if this body cannot move so, or the scale is out of range."""
        if action is not Action.STOP and action not in self.moves:
            known = ", ".join(self.moves)
            raise ValueError(f"the robot {self.name!r} knows no move {action!r}; it knows: {known}")
        if not 0.0 < speed_scale <= 1.0:
            raise ValueError(f"speed_scale must lie in (0, 1], not {speed_scale}")

    def wheels_mps(self, action: Action) -> tuple[float, float] | None:
        """Return how fast the left and right wheel roll at full speed; None if not known."""
        return None

    def take_button(self) -> BodyButton | None:
        """Return what a button on the body asked for since the last call; most bodies have none."""
        return None

    def advise(self, prediction: Prediction) -> None:  # noqa: B027
        """Take what the learner would do on the newest frame; must return at once, never raises."""

    def announce(self, address: str) -> None:  # noqa: B027 - a body without a screen says nothing
        """Take the page's address, for a body that can show it; called before `connect`."""

    def show(self, mode: Mode) -> None:  # noqa: B027
        """Show the mode on the body's own screen and lights, if it has any. Never raises."""

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.disconnect()
