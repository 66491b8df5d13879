"""Corrections for a robot that is built or wired differently from what its driver expects.

A correction changes the values sent to the motors, or the orientation of the pictures. A correction
never changes the meaning of a move: `left` still means left on the page, in recordings and for the
learner.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robot.camera import Camera, Mounting
from robot.driver import Correction, Driver
from robot.errors import ConfigurationError, need
from robot.moves import move_at, point_of
from robot.types import Action, Encoding, Frame, Point

if TYPE_CHECKING:
    from robot.devices.rig import Rig

MOST_TRIM = 0.3
"""Largest trim that can be set, as a share of full lock. A robot that needs more has a broken motor
or wheel."""
REVERSED = ("none", "left", "right", "both")
TURNS_DEG = (0, 90, 180, 270)
_JPEG_QUALITY = 90
"""JPEG quality for encoding a turned picture again, almost without loss."""
Pair = tuple[float, float]
_OTHER = {"left": "right", "right": "left"}
_NOT_CORRECTED = {
    "reverse": "its own program turns the motors, so reverse them in that program",
    "swap_sides": "it has no moves that steer left and right",
    "trim": "it is not steered proportionally",
}
"""The reasons why a body cannot apply a correction, by the correction's name. Error messages quote
them."""


@dataclass(frozen=True, kw_only=True)
class BodyCorrection(Correction):
    """The differences between a body and what its driver expects.

    Args:
        reverse: The motors that turn in the wrong direction: `none`, `left`, `right` or `both`,
            named as in the driver's options.
        swap_sides: True if the left and the right motor are plugged in at each other's port.
        trim: Steering that is added when the robot should drive straight, as a share of full lock.
            A positive trim steers to the right, for a robot that pulls to the left.

    Raises:
        ConfigurationError: If a value is out of range.

    Example:
        >>> pulls_left = BodyCorrection(trim=0.1)
        >>> pulls_left.point(Point(0.0, 0.5)), pulls_left.point(Point(1.0, 0.5)).steering
        (Point(steering=0.1, throttle=0.5), 1.0)
        >>> BodyCorrection(reverse="left", swap_sides=True).wheels((-1.0, 2.0))
        (2.0, 1.0)
    """

    reverse: str = "none"
    swap_sides: bool = False
    trim: float = 0.0

    def __post_init__(self) -> None:
        if self.reverse not in REVERSED:
            raise ConfigurationError(
                f"reverse must be one of {', '.join(REVERSED)}, not {self.reverse!r}"
            )
        if not -MOST_TRIM <= self.trim <= MOST_TRIM:
            raise ConfigurationError(
                f"trim must be a number from -{MOST_TRIM} to {MOST_TRIM}, not {self.trim}"
            )

    @property
    def signs(self) -> Pair:
        """The factors, 1 or -1, for the values of the left and the right motor."""
        left, right = (-1.0 if self.reverse in (side, "both") else 1.0 for side in REVERSED[1:3])
        return left, right

    def drive(
        self, body: Driver, action: Action, point: Point | None, *, speed_scale: float
    ) -> Action:
        """Send the corrected move or point; return the uncorrected move. Raises the errors of
        `Driver.send_action`."""
        if not self.swap_sides and self.trim == 0.0:
            return super().drive(body, action, point, speed_scale=speed_scale)
        is_proportional = point is not None and body.takes_points
        meant = body.move_of(point) if point is not None and is_proportional else action
        body.check_action(meant, speed_scale)
        at = point if is_proportional else point_of(meant, body.declared_moves)
        if at is not None and body.takes_points and meant is not Action.STOP:
            body.send_point(self.point(at), speed_scale=speed_scale)
        else:
            sent = mirrored(meant, body) if self.swap_sides else meant
            body.send_action(sent, speed_scale=speed_scale)
        return meant

    def point(self, point: Point) -> Point:
        """Return the steering and throttle to send so that the robot really drives with the
        steering and throttle of `point`.

        The trim decreases towards full lock. A spin on the spot has no trim.
        """
        steering, throttle = point
        if throttle:
            steering += self.trim * (1.0 - abs(steering))
        return Point(-steering if self.swap_sides else steering, throttle)

    def motors(self, values: Pair) -> Pair:
        """Return the values for both motors with corrected signs. Swapped sides are corrected by
        `point`, not by this function."""
        return values[0] * self.signs[0], values[1] * self.signs[1]

    def wheels(self, turned: Pair) -> Pair:
        """Return how far the robot's left and right wheel turned, given the motors' counts."""
        left, right = self.motors(turned)
        return (right, left) if self.swap_sides else (left, right)


def mirrored(action: Action, body: Driver) -> Action:
    """Return the mirror image of a body's move; a straight move is its own mirror image."""
    name = Action("_".join(_OTHER.get(word, word) for word in action.split("_")))
    at = point_of(action, body.declared_moves)
    if name is not action and name in body.moves:
        return name
    if at is None or not at.steering:
        return action
    return move_at(Point(-at.steering, at.throttle), body.declared_moves) or action


def possible_corrections(body: Driver) -> tuple[str, ...]:
    """Return the fields of `BodyCorrection` that apply to this body."""
    names = ["reverse"] if body.turns_motors else []
    if any(mirrored(move, body) is not move for move in body.moves):
        names.append("swap_sides")
    return (*names, "trim") if body.takes_points else tuple(names)


def check_correction(body: Driver, correction: BodyCorrection) -> None:
    """Raise ConfigurationError, with the reason, if a correction does not apply to this body."""
    possible, wanted = possible_corrections(body), BodyCorrection()
    for name, reason in _NOT_CORRECTED.items():
        if name not in possible and getattr(correction, name) != getattr(wanted, name):
            raise ConfigurationError(
                f"{name!r} does not apply to the robot {body.name!r}: {reason}"
            )


@dataclass(frozen=True, kw_only=True)
class CameraCorrection(Mounting):
    """The mounting of a camera.

    Args:
        turn_deg: Degrees by which the pictures are turned clockwise to make them upright.
        is_mirrored: True if the turned pictures are also mirrored, for a camera that looks into a
            mirror.

    Raises:
        ConfigurationError: If a value is out of range.
    """

    turn_deg: int = 0
    is_mirrored: bool = False

    def __post_init__(self) -> None:
        if self.turn_deg not in TURNS_DEG:
            wanted = ", ".join(map(str, TURNS_DEG))
            raise ConfigurationError(f"turn_picture must be one of {wanted}, not {self.turn_deg}")

    @property
    def is_upright(self) -> bool:
        """True if the camera's pictures need no change."""
        return self == CameraCorrection()

    def upright(self, picture: Frame) -> Frame:
        """Return the picture as if the camera stood upright. An unreadable picture is unchanged.

        Raw pixels are moved without changing their values, while a turned JPEG is encoded again.

        Raises:
            MissingExtraError: If a JPEG must be turned and OpenCV is not installed.
        """
        if self.is_upright:
            return picture
        try:
            return _TURNS[picture.encoding](self, picture)
        except ValueError:  # the data has a wrong length, which the picture's reader will report
            return picture

    def _turned(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        turned = np.rot90(pixels, -self.turn_deg // 90)
        return turned[:, ::-1] if self.is_mirrored else turned

    def _rgb(self, picture: Frame) -> Frame:
        pixels = np.frombuffer(picture.data, np.uint8)
        turned = self._turned(pixels.reshape(picture.height, picture.width, 3))
        return _made(picture, turned.tobytes(), turned)

    def _yuyv(self, picture: Frame) -> Frame:
        """Turn a YUYV picture. In YUYV two neighbours in a row share a colour, and a turn by 90
        degrees makes other pixels neighbours."""
        rows, columns = picture.height, picture.width
        packed = np.frombuffer(picture.data, np.uint8).reshape(rows, columns, 2)
        colours = packed[:, :, 1].reshape(rows, columns // 2, 2).repeat(2, axis=1)
        luma, colours = self._turned(packed[:, :, 0]), self._turned(colours)
        luma = luma[:, : luma.shape[1] // 2 * 2]
        rows, columns = luma.shape
        pairs = colours[:, :columns].reshape(rows, columns // 2, 2, 2).astype(np.uint16)
        shared = (pairs.sum(axis=2) + 1) // 2
        turned = np.stack([luma, shared.reshape(rows, columns).astype(np.uint8)], axis=2)
        return _made(picture, turned.tobytes(), turned)

    def _jpeg(self, picture: Frame) -> Frame:
        cv2 = need("cv2", "turning a camera's pictures", "camera")
        data = np.frombuffer(picture.data, np.uint8)
        try:
            pixels = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
        except cv2.error:
            pixels = None
        if pixels is None:
            return picture
        turned = np.ascontiguousarray(self._turned(pixels))
        _, jpeg = cv2.imencode(".jpg", turned, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        return _made(picture, jpeg.tobytes(), turned)


def _made(picture: Frame, data: bytes, pixels: NDArray[np.uint8]) -> Frame:
    return replace(picture, data=data, width=pixels.shape[1], height=pixels.shape[0])


def check_mounting(camera: Camera, mounting: CameraCorrection) -> None:
    """Check that this camera's pictures can be turned.

    Raises:
        ConfigurationError: If this camera's pictures cannot be turned.
        MissingExtraError: If turning needs OpenCV, and OpenCV is not installed.
    """
    if mounting.is_upright:
        return
    if not camera.can_be_turned:
        raise ConfigurationError(f"the camera {camera.name!r} cannot turn its pictures")
    newest = camera.latest()
    if newest is None or newest.encoding is Encoding.JPEG:
        need("cv2", "turning a camera's pictures", "camera")


_TURNS = {
    Encoding.RGB: CameraCorrection._rgb,
    Encoding.YUYV: CameraCorrection._yuyv,
    Encoding.JPEG: CameraCorrection._jpeg,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Corrections:
    """The corrections of one robot: those of its body and of its camera."""

    body: BodyCorrection = field(default_factory=BodyCorrection)
    camera: CameraCorrection = field(default_factory=CameraCorrection)

    @classmethod
    def of(cls, rig: Rig) -> Corrections:
        """Return the current corrections of a robot."""
        body, camera = rig.driver.correction, rig.camera.mounting
        return cls(
            body=body if isinstance(body, BodyCorrection) else BodyCorrection(),
            camera=camera if isinstance(camera, CameraCorrection) else CameraCorrection(),
        )

    def apply(self, rig: Rig) -> None:
        """Stop the robot, and correct body and camera. Runs on the loop's thread between two ticks.

        Raises:
            ConfigurationError: If a correction does not apply. Then no correction is changed.
            DriveError: If the body refuses the correction.
        """
        check_correction(rig.driver, self.body)
        check_mounting(rig.camera, self.camera)
        rig.camera.mounting = self.camera
        if self.body != Corrections.of(rig).body:
            with rig.loop.body.lock:
                rig.loop.body.ask("stop")
                rig.loop.body.ask("correct", self.body)

    def described(self) -> dict[str, Any]:
        """Return the corrections as plain values, by the names of their options."""
        return {
            "reverse": self.body.reverse,
            "swap_sides": self.body.swap_sides,
            "trim": self.body.trim,
            "turn_picture": self.camera.turn_deg,
            "mirror_picture": self.camera.is_mirrored,
        }

    def changed(self, **values: Any) -> Corrections:
        """Return a copy of the corrections with some values changed; a value of None keeps the old
        value.

        Raises:
            ConfigurationError: If a value is out of range.
        """
        now = {**self.described(), **{n: v for n, v in values.items() if v is not None}}
        return Corrections(
            body=BodyCorrection(
                reverse=now["reverse"], swap_sides=now["swap_sides"], trim=now["trim"]
            ),
            camera=CameraCorrection(
                turn_deg=now["turn_picture"], is_mirrored=now["mirror_picture"]
            ),
        )
