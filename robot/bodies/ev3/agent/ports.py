"""Devices of the kernel's motor and sensor classes: a folder each, with a file for an attribute."""

import glob
import io
import os
from typing import Any, Dict, List, Optional, Tuple

try:
    from robot.errors import DriveError as DriveError
except ImportError:  # the agent takes nothing newer than Python 3.5 along

    class DriveError(Exception):  # type: ignore[no-redef]
        """A motor, sensor or camera is missing or failed; the sentence says which, what to do."""


class DevicePort:
    """One device; its attribute files stay open, since opening costs more than reading."""

    def __init__(self, folder: str) -> None:
        self._folder = folder
        self._files = {}  # type: Dict[Tuple[str, int], Any]
        self.driver, self.address = self._glance("driver_name"), self._glance("address")

    def _glance(self, name: str) -> str:
        try:
            with open(os.path.join(self._folder, name)) as file:
                return file.readline().strip()
        except OSError:
            return "?"  # it was unplugged just now

    def read(self, name: str) -> str:
        text = self._file(name, os.O_RDONLY).read().decode()
        return str(text).partition("\n")[0].strip()

    def write(self, name: str, value: object) -> None:
        """Set an attribute. It ends in a newline, as `echo` ends it, so that no longer old
        value shows behind it where the attributes are plain files."""
        self._file(name, os.O_WRONLY).write("{}\n".format(value).encode())

    def _file(self, name: str, flags: int) -> Any:
        file = self._files.get((name, flags))
        if file is None:
            opened = os.open(os.path.join(self._folder, name), flags)
            file = io.FileIO(opened, "w" if flags == os.O_WRONLY else "r")
            self._files[name, flags] = file
        file.seek(0)
        return file

    def close(self) -> None:
        """Close the attribute files; the next use opens them again."""
        for file in self._files.values():
            file.close()
        self._files.clear()


def list_ports(root: str, kind: str) -> List[DevicePort]:
    """Return every device of a class, by port."""
    found = [DevicePort(folder) for folder in glob.glob(os.path.join(root, "sys/class", kind, "*"))]
    return sorted(found, key=lambda port: port.address)


def find_battery(root: str) -> Optional[DevicePort]:
    """Return the brick's battery, or None."""
    found = glob.glob(os.path.join(root, "sys/class/power_supply/*ev3-battery"))
    return DevicePort(found[0]) if found else None


def describe_ports(ports: List[DevicePort]) -> str:
    """Describe what is plugged in instead, for an error."""
    found = ["{} at {}".format(port.driver, port.address) for port in ports]
    return "found: " + (", ".join(found) or "nothing")
