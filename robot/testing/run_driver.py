"""Collected by `pytest --drivelesson-driver NAME`."""

from robot.testing.driver_contract import DriverContract


class TestDriver(DriverContract):
    """The contract, on the driver that was named."""
