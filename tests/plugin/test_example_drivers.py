"""The driver packages under docs/examples work with real MAVLink bytes, and with the Thymio
manager's own classes."""

from __future__ import annotations

import contextlib
import tomllib
from pathlib import Path
from typing import Any

import pytest

from robot.errors import DriveError
from robot.testing.driver_contract import DriverContract
from robot.types import Action, Point
from tests.contract.real_parts import SHORT, WHOLE, check_real_case
from tests.kit.sizes import IS_FULL
from tests.kit.wait import wait_until
from tests.plugin.environment import imported

EXAMPLES = Path(__file__).parents[2] / "docs/examples"


def check_the_package_and_the_contract(name: str, kit: Any) -> None:
    """tests/plugin/test_third_party.py runs the suite as the author of a package does."""
    project = tomllib.loads((EXAMPLES / name / "pyproject.toml").read_text("utf-8"))["project"]
    made = {name: f"drivelesson_{name}:{name.capitalize()}Driver"}
    assert project["entry-points"]["drivelesson.drivers"] == made
    short = (DriverContract.test_right_is_positive_and_so_is_ahead, *SHORT)
    whole = [check for check in WHOLE if "declares" not in check.__name__]
    check_real_case(lambda: kit.pytest_drivelesson_driver(name), whole if IS_FULL else short)


def check_each_autopilot_gets_its_own_numbers_and_timeout(kit: Any, module: Any, name: str) -> None:
    [kind] = [kind for kind, (known, _) in module.AUTOPILOTS.items() if known == name]
    with kit.rover(autopilot=kind) as body:
        options = module.RoverOptions(
            rover_address=body.address, rover_arm=True, rover_throttle=0.5
        )
        with module.RoverDriver(options) as driver:
            assert list(body.parameters.values()) == [pytest.approx(0.4)]
            assert driver.device == f"{name}, armed" and body.is_armed
            driver.send_point(Point(-0.25, 0.8), speed_scale=0.5)
            wait_until(lambda: body.drives() == Point(-0.25, 0.2))
            driver.send_action(Action.BACKWARD)
            wait_until(lambda: body.drives() == Point(0.0, -0.25))
            wait_until(lambda: body.drives() == Point(0.0, 0.0))
            assert driver.sense().battery_share == 0.8
        wait_until(lambda: not body.is_armed)


def check_arming_and_the_rovers_own_refusal(kit: Any, module: Any) -> None:
    with kit.rover(may_arm=False) as body:
        with pytest.raises(DriveError, match=r"ARM_DISARM: MAV_RESULT_FAILED.*PreArm: no GPS"):
            module.RoverDriver(
                module.RoverOptions(rover_address=body.address, rover_arm=True)
            ).connect()
        with module.RoverDriver(module.RoverOptions(rover_address=body.address)) as driver:
            assert driver.device == "ArduPilot, disarmed"
            with pytest.raises(
                DriveError, match="disarmed; arm it, or start with --rover-arm true"
            ):
                driver.send_action(Action.FORWARD)
            driver.send_action(Action.STOP)
            body.is_armed = True  # the owner switches the mode; the next heartbeat reports it
            wait_until(lambda: driver.sense() and driver.device == "ArduPilot, armed")
            driver.send_action(Action.FORWARD)
            wait_until(lambda: body.drives().throttle > 0)


def check_a_lost_rover_is_disarmed_at_the_end(kit: Any, module: Any) -> None:

    def answers() -> bool:
        with contextlib.suppress(DriveError):
            driver.sense()
            return True
        return False

    with kit.rover() as body:
        options = module.RoverOptions(rover_address=body.address, rover_arm=True)
        with module.RoverDriver(options) as driver:
            body.is_cut = True
            wait_until(lambda: not answers())
            body.is_cut = False
            wait_until(answers)
            assert body.is_armed
        wait_until(lambda: not body.is_armed)


def check_an_autopilot_without_the_parameter_is_named(kit: Any, module: Any) -> None:
    with kit.rover() as body:
        body.parameters = {"OTHER": 3.0}
        body.drives = lambda: Point(0.0, 0.0)
        with module.RoverDriver(module.RoverOptions(rover_address=body.address)) as driver:
            assert driver.device == "ArduPilot, disarmed, without a timeout of its own"


@pytest.mark.realtime
def test_a_rover_and_a_thymio_keep_the_contract_on_their_real_lines() -> None:
    for library in ("pymavlink", "tdmclient"):
        pytest.importorskip(library)
    with imported(EXAMPLES / "rover", "conftest", "drivelesson_rover") as (kit, module):
        check_the_package_and_the_contract("rover", kit)
        for name in ("ArduPilot", "PX4"):
            check_each_autopilot_gets_its_own_numbers_and_timeout(kit, module, name)
        check_arming_and_the_rovers_own_refusal(kit, module)
        check_a_lost_rover_is_disarmed_at_the_end(kit, module)
        check_an_autopilot_without_the_parameter_is_named(kit, module)
    with imported(EXAMPLES / "thymio", "conftest", "drivelesson_thymio") as (kit, module):
        check_the_package_and_the_contract("thymio", kit)
        manager = kit.Manager()
        manager.node.status = 3
        options = module.ThymioOptions(thymio_manager=manager.address, thymio_speed=500)
        with pytest.raises(DriveError, match="does another program use the Thymio"):
            module.ThymioDriver(options).connect()
        manager.node.status = 2
        with module.ThymioDriver(options) as driver:
            assert driver.device == "Anna"
            driver.send_point(Point(0.0, 1.0))
            assert manager.node.variables["motor.left.target"] == [500], "the Thymio refuses 1000"
        assert manager.node.status == 2 and manager.drives() == Point(0.0, 0.0)
        with pytest.raises(DriveError, match="sees no Thymio named 'Bea'"):
            other = module.ThymioOptions(thymio_manager=manager.address, thymio_name="Bea")
            module.ThymioDriver(other).connect()
        manager.end()
