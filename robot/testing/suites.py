"""Collected by `pytest --drivelesson-driver NAME` and `--drivelesson-camera NAME`."""

from robot.testing.camera_contract import CameraContract
from robot.testing.driver_contract import DriverContract


class TestDriver(DriverContract):
    """The contract, on the driver that was named."""


class TestCamera(CameraContract):
    """The contract, on the camera that was named."""
