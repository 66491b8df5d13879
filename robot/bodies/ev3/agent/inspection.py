"""Measures the state of a brick for `drivelesson brick doctor`. Changes nothing."""

import os
import platform
import time
from typing import Any, Dict, List

from robot.bodies.ev3.agent.ports import find_battery, list_ports
from robot.bodies.ev3.agent.release import RELEASE
from robot.bodies.v4l2.device import CaptureError, describe_camera, list_cameras


def inspect_brick(root: str) -> Dict[str, Any]:
    """Return the versions of the software, and the state of ports, battery, memory, card, cameras
    and clock; unknown values are None."""
    return {
        "release": RELEASE,
        "python": platform.python_version(),
        "kernel": platform.release(),
        "machine": platform.machine(),
        "clock_s": time.time(),
        "motors": describe(root, "tacho-motor"),
        "sensors": describe(root, "lego-sensor"),
        "battery_v": read_voltage(root),
        "memory_mb": read_memory_mb(root),
        "card_mb": read_card_mb(root),
        "cameras": find_cameras(),
    }


def describe(root: str, kind: str) -> List[Dict[str, str]]:
    """Return the driver_name and the address of every device of a class, in order of the ports."""
    ports = list_ports(root, kind)
    return [{"driver_name": port.driver, "address": port.address} for port in ports]


def read_voltage(root: str) -> Any:
    battery = find_battery(root)
    if battery is None:
        return None
    try:
        return float(battery.read("voltage_now")) / 1e6
    except Exception:
        return None
    finally:
        battery.close()


def read_memory_mb(root: str) -> Any:
    try:
        with open(os.path.join(root, "proc/meminfo")) as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) / 1024.0
    except OSError:
        pass
    return None


def read_card_mb(root: str) -> float:
    card = os.statvfs(root)
    return card.f_bavail * card.f_frsize / 1e6


def find_cameras() -> List[Dict[str, Any]]:
    """Return the device of each camera, with its formats or with the reason why it cannot be
    opened."""
    found = []
    for path in list_cameras():
        try:
            found.append({"device": path, "offers": describe_camera(path)})
        except CaptureError as error:
            found.append({"device": path, "fault": str(error)})
    return found
