"""Devices of the kernel's motor and sensor classes, found through python-ev3dev2."""

import os
from typing import Any, Dict, List, Optional


class HardwareError(Exception):
    """A motor, sensor or camera is missing or failed; the sentence says which and what to do."""


class DevicePort:
    """One device of the kernel's; its attribute files stay open, since opening costs more."""

    def __init__(self, device: Any, address: str) -> None:
        self.address = address
        self._device = device
        self._files = {}  # type: Dict[str, Any]

    def read(self, name: str) -> str:
        file, value = self._device.get_attr_string(self._files.get(name), name)
        self._files[name] = file
        return str(value).partition("\n")[0]

    def write(self, name: str, value: object) -> None:
        """Set an attribute. It ends in a newline, as `echo` ends it, so that no longer old
        value shows behind it where the attributes are plain files."""
        self._files[name] = self._device.set_attr_raw(
            self._files.get(name), name, "{}\n".format(value)
        )

    def close(self) -> None:
        """Close the attribute files; the next use opens them again."""
        for file in self._files.values():
            file.close()
        self._files.clear()


def find_port(kind: str, pattern: str, **attributes: Any) -> Optional[DevicePort]:
    """Return the first device of a class whose attributes match, or None."""
    from ev3dev2 import Device, DeviceNotFound

    try:
        return DevicePort(Device(kind, pattern, **attributes), attributes.get("address", ""))
    except DeviceNotFound:
        return None


def list_ports(root: str, kind: str) -> List[Dict[str, str]]:
    """Return driver_name and address of every device of a class, by port."""
    folder = os.path.join(root, "sys/class", kind)
    found = []
    for name in os.listdir(folder) if os.path.isdir(folder) else []:
        entry = {}
        for attribute in ("driver_name", "address"):
            try:
                with open(os.path.join(folder, name, attribute)) as file:
                    entry[attribute] = file.readline().strip()
            except OSError:
                entry[attribute] = "?"  # it was unplugged just now
        found.append(entry)
    return sorted(found, key=lambda entry: entry["address"])


def describe_ports(root: str, kind: str) -> str:
    """Describe what is plugged in instead, for an error."""
    found = [" at ".join((x["driver_name"], x["address"])) for x in list_ports(root, kind)]
    return "found: " + (", ".join(found) or "nothing")
