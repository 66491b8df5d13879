"""Devices of the kernel's motor and sensor classes, through python-ev3dev2."""

import glob
import os
from typing import Any, Dict, List, Optional

try:
    from robot.errors import DriveError as DriveError
except ImportError:  # the agent's archive includes only modules for Python 3.5

    class DriveError(Exception):  # type: ignore[no-redef]
        """A motor, sensor or camera is missing or failed. The message names the device and the
        remedy."""


class DevicePort:
    """One device; its attribute files stay open, because opening takes longer than reading."""

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._device = _open_device(folder)
        self._files = {}  # type: Dict[str, Any]
        self.driver, self.address = self._glance("driver_name"), self._glance("address")

    def _glance(self, name: str) -> str:
        try:
            with open(os.path.join(self._folder, name)) as file:
                return file.readline().strip()
        except OSError:
            return "?"  # the device was just unplugged

    def is_at(self, wanted: str) -> bool:
        """True if the device is at this port. The address of the port "outB" is
        "ev3-ports:outB"."""
        return ":{}:".format(wanted.strip()) in ":{}:".format(self.address)

    def read(self, name: str) -> str:
        self._files[name], text = self._device.get_attr_string(self._files.get(name), name)
        return str(text).partition("\n")[0]

    def write(self, name: str, value: object) -> None:
        """Set an attribute, and append a newline, like `echo`. Tests use plain files, which are not
        truncated: if the old value was longer, its end remains after the newline. `read` therefore
        ignores everything after the newline."""
        text = "{}\n".format(value)
        self._files[name] = self._device.set_attr_raw(self._files.get(name), name, text)

    def close(self) -> None:
        """Close the device's attribute files. The next use of the device opens them again."""
        for file in self._files.values():
            file.close()
        self._files.clear()


def _open_device(folder: str) -> Any:
    try:
        import ev3dev2
    except ImportError:
        raise DriveError(
            "python-ev3dev2 is not installed; install it with: pip install 'drivelesson[ev3]'"
        ) from None
    kind, name = os.path.split(folder)
    ev3dev2.Device.DEVICE_ROOT_PATH, kind = os.path.split(kind)
    return ev3dev2.Device(kind, name, name_exact=True)


def list_ports(root: str, kind: str) -> List[DevicePort]:
    """Return every device of a class, in order of the ports."""
    found = [DevicePort(folder) for folder in glob.glob(os.path.join(root, "sys/class", kind, "*"))]
    return sorted(found, key=lambda port: port.address)


def find_battery(root: str) -> Optional[DevicePort]:
    found = glob.glob(os.path.join(root, "sys/class/power_supply/*ev3-battery"))
    return DevicePort(found[0]) if found else None


def describe_ports(ports: List[DevicePort]) -> str:
    """Describe the devices that are plugged in, for an error message."""
    found = ["{} at {}".format(port.driver, port.address) for port in ports]
    return "found: " + (", ".join(found) or "nothing")
