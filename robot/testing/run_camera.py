"""Collected by `pytest --drivelesson-camera NAME`."""

from robot.testing.camera_contract import CameraContract


class TestCamera(CameraContract):
    """The contract, on the camera that was named."""
