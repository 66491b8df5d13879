"""Finds a USB camera again: Linux may give it another number when it is plugged in again.

A lost camera is searched for by its make and serial number, or by its socket if it has no serial
number: of two cameras of the same make, the other one is not taken in its place.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

_ROOT = Path("/sys/class/video4linux")


def identity_of(number: int, root: Path = _ROOT) -> str | None:
    """Return a lasting identity of a USB camera; None if the system does not tell."""
    node = root / f"video{number}"
    try:
        device = (node / "device").resolve(strict=True).parent
        make = [(device / name).read_text().strip() for name in ("idVendor", "idProduct")]
        index = (node / "index").read_text().strip()
    except OSError:
        return None
    serial = ""
    with contextlib.suppress(OSError):
        serial = (device / "serial").read_text().strip()
    return " ".join([*make, f"serial {serial}" if serial else f"port {device.name}", index])


def number_of(identity: str, root: Path = _ROOT) -> int | None:
    """Return the number that the camera has now; None if it is not plugged in.

    None also if two cameras have the same serial number, as in a batch of cheap ones.
    """
    try:
        numbers = [int(node.name[5:]) for node in root.iterdir() if node.name[5:].isdigit()]
    except OSError:
        return None
    found = [number for number in numbers if identity_of(number, root) == identity]
    return found[0] if len(found) == 1 else None
