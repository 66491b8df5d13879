"""The device of a driver: chosen at the first connection, and never replaced. Pure.

Schools own dozens of hubs with the same name. A search by name finds any of these hubs, so after a
lost connection the program might drive a neighbour's robot. If two hubs match at the start, the
program cannot know which one the pilot means.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Found:
    """A device that a search has found: its name, and its unique address."""

    name: str
    address: str

    def __str__(self) -> str:
        return f"{self.name!r} ({self.address})" if self.name else self.address

    def is_called(self, wanted: str) -> bool:
        """True if `wanted` may stand for this device. An empty `wanted` stands for any device."""
        return wanted in ("", self.name) or wanted.lower() == self.address.lower()


class SameDevice:
    """Remembers and recognises the one device of a driver.

    Args:
        kind: The noun for the device in a sentence, for example `hub`.
        wanted: The name or address that a person gave; empty for the only device in range.
        flag: The option with which the user chooses a device.
    """

    def __init__(self, kind: str, wanted: str = "", flag: str = "--hub") -> None:
        self._kind, self._wanted, self._flag = kind, wanted, flag
        self.chosen: Found | None = None
        """The device that was connected; None before the first connection."""

    def may_be(self, found: Found) -> bool:
        """True if this device could be the driver's."""
        if self.chosen is not None:
            return found.address == self.chosen.address
        return found.is_called(self._wanted)

    def is_certain(self, found: Found) -> bool:
        """True if this must be the driver's device."""
        wanted = self.chosen.address if self.chosen is not None else self._wanted
        return found.address.lower() == wanted.lower()

    def pick(self, found: Iterable[Found]) -> Found | None:
        """Return the driver's device among all found devices; None if it is missing.

        Raises:
            ConnectionError: If several devices match; the error lists them and says how to choose
                one.
        """
        fitting = {one.address: one for one in found if self.may_be(one)}
        if len(fitting) > 1:
            first, *_ = sorted(fitting)
            listed = ", ".join(str(fitting[address]) for address in sorted(fitting))
            raise ConnectionError(
                f"{len(fitting)} {self._kind}s in range match: {listed}; choose yours with "
                f"{self._flag} {first}, or give each device a different name"
            )
        return next(iter(fitting.values()), None)

    def name_absent(self, found: Iterable[Found]) -> str:
        """Return the end of the error message for a device that was not found. The text mentions
        the devices that were found."""
        others = {str(one) for one in found}
        if self.chosen is None:
            listed = f"; in range: {', '.join(sorted(others))}" if others else ""
            return f"is it switched on, and not connected elsewhere?{listed}"
        aside = f" (another {self._kind} is in range, but is not used)" if others else ""
        return f"{self.chosen} was lost, and is not in range{aside}; is it switched on?"
