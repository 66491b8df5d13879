"""Corrections for each mounting of a camera, each wiring of motors, and for unequal motors."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest

from robot.adjustments.corrections import (
    REVERSED,
    TURNS_DEG,
    BodyCorrection,
    CameraCorrection,
    Corrections,
    check_correction,
    possible_corrections,
)
from robot.bodies.gpio.driver import GpioOptions
from robot.bodies.gpio.wheels import TimedMotors, steered, tracked
from robot.devices.encoders import jpeg_encoder
from robot.devices.rig import build_rig
from robot.driver import Pose
from robot.errors import ConfigurationError
from robot.moves import CLASSIC
from robot.policy.image import decode, to_rgb
from robot.simulator.body import WHEELS, move
from robot.testing import FakeCamera, FakeDriver, VirtualClock
from robot.types import Action, Encoding, Frame, Point
from tests.kit.frames import make_frame
from tests.kit.sizes import crossed

WAYS = [CameraCorrection(turn_deg=t, is_mirrored=m) for t, m in product(TURNS_DEG, (False, True))]
RNG = np.random.default_rng(1)


def hung(pixels: np.ndarray, mounting: CameraCorrection) -> np.ndarray:
    """Return the picture of a camera that is turned, and perhaps looks into a mirror."""
    seen = pixels[:, ::-1] if mounting.is_mirrored else pixels
    return np.ascontiguousarray(np.rot90(seen, mounting.turn_deg // 90))


@pytest.mark.parametrize("mounting", WAYS, ids=str)
def test_a_camera_publishes_upright_pictures_however_it_is_mounted(mounting):
    """If the pictures are equal, the robot learns and drives equally."""
    scene = RNG.integers(60, 200, (3, 4, 3), np.uint8).repeat(16, axis=0).repeat(16, axis=1)
    camera, seen = FakeCamera(VirtualClock()), hung(scene, mounting)
    camera.mounting = mounting
    sides = {"width": seen.shape[1], "height": seen.shape[0], "captured_s": 0.0}
    plain = camera._publish(seen.tobytes(), encoding=Encoding.RGB, **sides)
    assert (plain.width, plain.height, plain.data) == (64, 48, scene.tobytes())
    jpeg = camera._publish(jpeg_encoder(95)(seen), encoding=Encoding.JPEG, **sides)
    pixels = decode(jpeg.data)
    assert pixels is not None and (jpeg.width, jpeg.height) == (64, 48)
    assert np.abs(pixels[:, :, ::-1].astype(int) - scene).mean() < 8


@pytest.mark.parametrize("mounting", WAYS, ids=str)
def test_raw_pictures_of_a_usb_camera_keep_their_brightness(mounting):
    luma = RNG.integers(16, 236, (48, 64), np.uint8)
    colours = RNG.integers(16, 241, (24, 32, 2), np.uint8).repeat(2, axis=0).repeat(2, axis=1)
    seen, tinted = hung(luma, mounting), hung(colours, mounting)
    height, width = seen.shape
    packed = np.stack([seen, tinted[:, ::2].reshape(height, width)], axis=2)
    upright = mounting.upright(make_frame(packed.tobytes(), Encoding.YUYV, width, height))
    assert (upright.width, upright.height, upright.encoding) == (64, 48, Encoding.YUYV)
    got = np.frombuffer(upright.data, np.uint8).reshape(48, 64, 2)
    assert (got[:, :, 0] == luma).all()
    assert (got[:, :, 1].reshape(48, 32, 2) == colours[:, ::2]).all()


@crossed(mounting=WAYS[1:], encoding=list(Encoding), sides=[(7, 6), (1, 1), (6, 5), (0, 0)])
def test_a_damaged_picture_is_passed_on_unturned(mounting, encoding, sides):
    """A damaged picture must not end the camera's thread; the code that reads it reports it."""
    width, height = sides
    for data in (b"", b"no picture", b"\xff\xd8\xff" + bytes(40)):
        taken = make_frame(data, encoding, width, height)
        turned = mounting.upright(taken)
        assert turned == taken or (data == b"" and width * height == 0)


def test_odd_raw_pictures_lose_a_line_at_most():
    taken = make_frame(bytes(2 * 6 * 5), Encoding.YUYV, 6, 5)
    turned = CameraCorrection(turn_deg=90).upright(taken)
    assert (turned.width, turned.height, len(turned.data)) == (4, 6, 2 * 4 * 6)


def test_a_simulated_camera_is_turned_in_both_of_its_sizes():
    rig = build_rig("sim", learner="default-8")
    camera: Any = rig.camera
    before = to_rgb(camera.capture()).astype(int)
    camera.mounting = CameraCorrection(turn_deg=90)
    frame = camera.capture()
    assert np.abs(np.rot90(before, -1) - to_rgb(frame)).mean() < 10, "only the noise differs"
    camera.for_the_eye(camera.take_jpeg())
    large: Frame = camera.for_the_eye(camera.take_jpeg())
    assert (large.width, large.height) == (240, 320)


class Motor:
    value = 0.0


def driven(correction: BodyCorrection, wired: BodyCorrection) -> list[float]:
    """Return how the wheels of a robot with this wiring turn for each move, left and right."""
    turns: list[float] = []
    for action in CLASSIC:
        motors = [Motor(), Motor()]
        wheels = TimedMotors(motors, tracked(0.6, 0.4), signs=correction.signs)
        at = CLASSIC[action].point
        assert at is not None
        steering, throttle = correction.point(at)
        wheels.obey(f"{action} 400 1.0 1 0 {steering} {throttle}".encode(), 0)
        turns += wired.wheels((motors[0].value, motors[1].value))
    return turns


def test_each_of_the_eight_ways_to_wire_two_motors_has_one_correction():
    plain = pytest.approx(driven(BodyCorrection(), BodyCorrection()))
    ways = [BodyCorrection(reverse=r, swap_sides=s) for r in REVERSED for s in (False, True)]
    for wired in ways:
        assert [other for other in ways if driven(other, wired) == plain] == [wired]


@pytest.mark.parametrize("motor_board", ["two-pwm", "phase-enable"])
def test_motors_can_be_reversed_while_the_board_is_connected(motor_board):
    """The keeper runs in this process, with gpiozero's mock pins."""
    pytest.importorskip("gpiozero", reason="the extra gpio is not installed")
    from tests.standins.gpio import MockPins

    with MockPins(VirtualClock()) as pins:
        driver = pins.driver(GpioOptions(motor_board=motor_board))
        with driver:
            driver.drive(Action.LEFT)
            plain = pins.wheels
            for reverse, swap_sides in product(REVERSED, (False, True)):
                wired = BodyCorrection(reverse=reverse, swap_sides=swap_sides)
                driver.stop()
                driver.correct(wired)
                assert not pins.is_moving
                assert driver.drive(Action.LEFT) is Action.LEFT
                assert wired.wheels(pins.wheels) == pytest.approx(plain), wired


def test_a_car_is_trimmed_by_its_servo():
    motors = [Motor(), Motor()]
    car = TimedMotors(motors, steered(0.6, 0.4, (-1.0, 1.0)), signs=(-1.0, 1.0))
    steering, throttle = BodyCorrection(trim=0.1).point(Point(0.0, 0.5))
    car.obey(f"forward 400 1.0 1 0 {steering} {throttle}".encode(), 0)
    assert (motors[0].value < 0, motors[1].value) == (True, pytest.approx(0.1))


@crossed(throttle=[0.5, -0.5], weaker=[0, 1])
def test_a_body_that_pulls_to_one_side_drives_straight_with_a_trim(weaker, throttle):
    """One motor is a tenth slower; the same trim helps ahead and backward."""

    def heading_after(trim):
        pose, correction = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0), BodyCorrection(trim=trim)
        for _ in range(100):
            wheels = list(WHEELS.at(correction.point(Point(0.0, throttle))))
            wheels[weaker] *= 0.9
            pose = move(pose, wheels[0], wheels[1], 0.05)
        return pose.heading_rad

    pulls = abs(heading_after(0.0))
    assert pulls > 0.3
    best = min(np.linspace(-0.3, 0.3, 61), key=lambda trim: abs(heading_after(trim)))
    assert abs(heading_after(best)) < 0.02 * pulls + 0.02
    assert math.copysign(1.0, best) == (1.0 if weaker == 0 else -1.0)


def test_values_out_of_range_are_refused():
    for values in ({"trim": 0.31}, {"trim": math.nan}, {"reverse": "up"}, {"turn_picture": 45}):
        with pytest.raises(ConfigurationError):
            Corrections().changed(**values)


def test_a_body_of_moves_only_has_its_sides_swapped_by_their_names():
    body = FakeDriver()
    assert possible_corrections(body) == ("swap_sides",)
    body.correct(BodyCorrection(swap_sides=True))
    for meant, sent in (("left", "right"), ("right", "left"), ("forward", "forward")):
        assert body.drive(Action(meant)) is Action(meant), "the meaning of the move stays the same"
        assert body.now is Action(sent)
    for refused in (BodyCorrection(trim=0.1), BodyCorrection(reverse="left")):
        with pytest.raises(ConfigurationError, match="does not apply to the robot 'fake'"):
            check_correction(body, refused)
