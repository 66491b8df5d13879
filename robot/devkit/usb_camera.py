"""Identifies the robot's USB camera. The program uses only the camera that it opened first.

Linux assigns new numbers to cameras that are plugged in again, so a number does not identify a
camera. A camera is identified by its make and serial number. If the serial number is not unique, as
with many cheap cameras, the camera is identified by the USB port at which it is plugged in. The
code runs on Python 3.5, because the agent on a brick includes this module.
"""

import os
import re
from typing import Dict, Iterable, List, NamedTuple, Optional

ROOT = "/sys/class/video4linux"
AUTO = "auto"

UsbCamera = NamedTuple(
    "UsbCamera",
    [("path", str), ("name", str), ("make", str), ("serial", str), ("port", str), ("part", str)],
)
"""`part` distinguishes the streams of one device: colour, infrared, or other data."""


class SeveralCamerasError(Exception):
    """Several cameras match; the message lists them and says how to choose one."""


class SameCamera:
    """Finds the one camera of a robot, and recognises it later.

    Args:
        wanted: The device that a person named, or `auto` for the only camera that is plugged in.
        flag: The option that names a camera.
        root: The folder in which the system lists its cameras.
    """

    def __init__(self, wanted: str, flag: str = "--device", root: Optional[str] = None) -> None:
        self._wanted, self._flag, self._root = wanted, flag, root
        self._is_unique = True
        self.chosen = None  # type: Optional[UsbCamera]

    def find(self) -> Optional[str]:
        """Return the device to open; None while the camera that was opened first is unplugged.

        Raises:
            SeveralCamerasError: If several cameras are plugged in and none was named.
        """
        if self.chosen is not None:
            mine = [one for one in list_usb_cameras(self._root) if self._is_same(one)]
            return mine[0].path if len(mine) == 1 else None
        if self._wanted != AUTO:
            return self._wanted
        devices = {}  # type: Dict[str, UsbCamera]
        for camera in list_usb_cameras(self._root):
            devices.setdefault(camera.port, camera)
        there = sorted(devices.values(), key=_number)
        if len(there) > 1:
            raise SeveralCamerasError(
                "{} cameras are plugged in: {}; choose yours with {} {}".format(
                    len(there), ", ".join(map(describe, there)), self._flag, there[0].path
                )
            )
        return there[0].path if there else AUTO

    def opened(self, path: str) -> None:
        """Remember the camera that was opened first."""
        cameras = list_usb_cameras(self._root)
        if self.chosen is None:
            real = os.path.realpath(path)
            self.chosen = next((one for one in cameras if one.path == real), None)
        self._look_for_twins(cameras)

    def lost(self) -> None:
        """Record that the camera is lost. If an identical camera is plugged in at another port, the
        serial number no longer identifies the robot's camera."""
        self._look_for_twins(list_usb_cameras(self._root))

    @property
    def is_absent(self) -> bool:
        """True if the robot's camera is known but not plugged in."""
        return self.chosen is not None and self.find() is None

    @property
    def device(self) -> str:
        """Description of the camera for the page, without its number; empty if unknown."""
        mine = self.chosen
        if mine is None:
            return ""
        by_serial = bool(mine.serial) and self._is_unique
        known_by = "serial number {}" if by_serial else "USB socket {}"
        lasting = known_by.format(mine.serial if by_serial else mine.port)
        return "{} ({})".format(mine.name or "USB camera", lasting)

    def _is_same(self, camera: UsbCamera) -> bool:
        mine = self.chosen
        if mine is None or (camera.make, camera.serial, camera.part) != (
            mine.make, mine.serial, mine.part
        ):  # fmt: skip
            return False
        return camera.port == mine.port or (bool(mine.serial) and self._is_unique)

    def _look_for_twins(self, cameras: Iterable[UsbCamera]) -> None:
        mine = self.chosen
        if mine is not None and any(c.port != mine.port and self._is_same(c) for c in cameras):
            self._is_unique = False


def describe(camera: UsbCamera) -> str:
    """Return a camera's name and device."""
    return "{} ({})".format(camera.name, camera.path) if camera.name else camera.path


def list_usb_cameras(root: Optional[str] = None) -> List[UsbCamera]:
    """Return the USB cameras that are plugged in, in the order of their numbers."""
    root = root or ROOT
    try:
        nodes = [node for node in os.listdir(root) if re.match(r"video\d+$", node)]
    except OSError:
        return []
    found = [_read(root, node) for node in nodes]
    return sorted((one for one in found if one is not None), key=_number)


def _read(root: str, node: str) -> Optional[UsbCamera]:
    there = os.path.join(root, node)
    interface = os.path.realpath(os.path.join(there, "device"))
    device = os.path.dirname(interface)
    try:
        make = " ".join(_text(device, name) for name in ("idVendor", "idProduct"))
        index = _text(there, "index")
    except OSError:  # not a USB camera, but part of the board or virtual
        return None
    part = "{} {}".format(os.path.basename(interface).partition(":")[2], index)
    texts = []
    for folder, name in ((there, "name"), (device, "serial")):
        try:
            texts.append(_text(folder, name))
        except OSError:
            texts.append("")
    return UsbCamera("/dev/" + node, texts[0], make, texts[1], os.path.basename(device), part)


def _text(folder: str, name: str) -> str:
    with open(os.path.join(folder, name), errors="replace") as file:
        return file.read().strip()


def _number(camera: UsbCamera) -> int:
    return int(camera.path[len("/dev/video") :])
